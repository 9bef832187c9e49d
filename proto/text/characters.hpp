#pragma once

#include <cstddef>
#include <string_view>

namespace proofmass::wire {

/// A character of UTF-8 and how many bytes it has; no character if these are not UTF-8.
struct Character {
  char32_t code = 0;
  std::size_t size = 1;
  bool is_valid = false;
};

/// @pre The text is not empty.
[[nodiscard]] Character first_character(std::string_view text);

}  // namespace proofmass::wire
