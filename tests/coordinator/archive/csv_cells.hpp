#pragma once

#include <gtest/gtest.h>

#include <charconv>
#include <string>
#include <system_error>
#include <vector>

namespace proofmass::test {

/// The cells of a line of CSV in which nothing is quoted.
inline std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char character : line) {
    if (character == ',') {
      cells.emplace_back();
    } else {
      cells.back() += character;
    }
  }
  return cells;
}

/// The number that a cell is; anything else fails the test.
inline double number(const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  EXPECT_TRUE(error == std::errc() && end == text.data() + text.size()) << text;
  return value;
}

}  // namespace proofmass::test
