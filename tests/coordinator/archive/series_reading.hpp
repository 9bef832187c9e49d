#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace proofmass::test {

/// What read_series.py prints, which reads with h5py: another program than the one that writes.
inline std::string read_series(const std::filesystem::path& file, const std::string& further = "") {
  const std::string text = file.string() + ".read";
  const std::string command = std::string("/usr/bin/python3 '") + PROOFMASS_READ_SERIES + "' '" +
                              file.string() + "' " + further + " > '" + text + "' 2>&1";
  const int status = std::system(command.c_str());
  std::ifstream stream(text, std::ios::binary);
  std::string answer{std::istreambuf_iterator<char>(stream), {}};
  std::filesystem::remove(text);
  EXPECT_EQ(status, 0) << answer;
  return status == 0 ? answer : std::string();
}

/// Attributes, sessions and datasets of a file.
inline nlohmann::json description_of_series(const std::filesystem::path& file) {
  return nlohmann::json::parse(read_series(file), nullptr, false);
}

/// Values of a field of a dataset: `a_c13/measured`, `mass_1_K_x`.
inline std::vector<double> series_in(const std::filesystem::path& file, const std::string& dataset,
                                     const std::string& field) {
  const std::string bytes = read_series(file, dataset + " " + field);
  std::vector<double> values(bytes.size() / sizeof(double));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(double));
  return values;
}

}  // namespace proofmass::test
