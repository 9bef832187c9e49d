#pragma once

#include <string_view>

namespace proofmass::wire {

/// The text of a file without the mark with which Windows programs begin UTF-8.
[[nodiscard]] inline std::string_view without_byte_order_mark(std::string_view text) {
  constexpr std::string_view mark = "\xEF\xBB\xBF";
  return text.starts_with(mark) ? text.substr(mark.size()) : text;
}

}  // namespace proofmass::wire
