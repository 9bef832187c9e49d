#include "coordinator/store/detail/file_log.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <fstream>

namespace proofmass::coordinator::detail {
namespace {

// SQLite's file format, section 4.1: a log begins with this number, whose last bit is the byte
// order of its checksums; 32 bytes are followed by frames of a header of 24 bytes and a page.
constexpr std::uint32_t log_magic = 0x377f0682;
constexpr std::size_t log_header_size = 32;
constexpr std::size_t frame_header_size = 24;

}  // namespace

std::filesystem::path log_path(const std::filesystem::path& file) {
  return std::filesystem::path(file).concat("-wal");
}

bool has_log(const std::filesystem::path& file) {
  std::ifstream stream(log_path(file), std::ios::binary);
  std::array<unsigned char, log_header_size + frame_header_size + 1> bytes{};
  stream.read(reinterpret_cast<char*>(bytes.data()), bytes.size());
  if (!stream) return false;
  std::uint32_t magic = 0;
  for (std::size_t i = 0; i < sizeof magic; ++i) magic = magic << 8 | bytes[i];
  return (magic & ~std::uint32_t{1}) == log_magic;
}

}  // namespace proofmass::coordinator::detail
