#pragma once

#include "proto/text/visible_text.hpp"
#include "tests/test.hpp"

namespace proofmass::test {

inline std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

MATCHER(FitsATerminal, "has at most 80 characters") { return wire::display_width(arg) <= 80; }

}  // namespace proofmass::test
