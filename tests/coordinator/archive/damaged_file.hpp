#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/store/detail/database.hpp"

namespace proofmass::test {

inline std::size_t number_at(const std::string& bytes, std::size_t at, std::size_t size) {
  std::size_t number = 0;
  for (std::size_t i = 0; i < size; ++i) {
    number = number << 8 | static_cast<unsigned char>(bytes.at(at + i));
  }
  return number;
}

/// Makes two rows of a small table, numbered below 128 by their key and all on one page, change
/// their keys, as bits that flip on a disk may: their order is not that of the tree any more.
inline void swap_keys(const std::filesystem::path& file, const std::string& table, unsigned a,
                      unsigned b) {
  using coordinator::detail::Access;
  const auto page = static_cast<std::size_t>(
      coordinator::detail::Database(file, Access::read_only)
          .integer("SELECT rootpage FROM sqlite_schema WHERE name = '" + table + "'"));
  std::ifstream stream(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  const std::size_t start = (page - 1) * number_at(bytes, 16, 2);
  constexpr char table_leaf = 13;
  if (bytes.at(start) != table_leaf) throw std::runtime_error("the table has several pages");
  std::vector<std::size_t> keys;  // Where the keys a and b stand.
  for (std::size_t cell = 0; cell < number_at(bytes, start + 3, 2); ++cell) {
    std::size_t at = start + number_at(bytes, start + 8 + 2 * cell, 2);
    while ((bytes.at(at) & 0x80) != 0) ++at;  // The size of the row.
    ++at;
    const auto key = static_cast<unsigned char>(bytes.at(at));
    if (key == a || key == b) keys.push_back(at);
  }
  if (keys.size() != 2) throw std::runtime_error("the rows are not there");
  std::swap(bytes[keys[0]], bytes[keys[1]]);
  std::ofstream(file, std::ios::binary) << bytes;
}

}  // namespace proofmass::test
