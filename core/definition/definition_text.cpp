#include "core/definition/definition_text.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>

namespace proofmass::detail {

std::string number_text(double value) {
  // Without a point TOML reads an integer, which has no negative zero.
  if (value == 0.0 && std::signbit(value)) return "-0.0";
  std::string text = fmt::format("{}", value);
  const std::size_t exponent = text.find('e');
  if (exponent == std::string::npos) return text;
  // `1e-05` and `1e+20` read better as `1e-5` and `1e20`.
  const std::size_t sign = exponent + 1;
  const std::size_t zeros_begin = sign + 1;
  const std::size_t zeros_end = text.find_first_not_of('0', zeros_begin);
  text.erase(zeros_begin, zeros_end - zeros_begin);
  if (text[sign] == '+') text.erase(sign, 1);
  return text;
}

std::string quoted_text(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      result += fmt::format("\\u{:04X}", static_cast<unsigned>(c));
    } else {
      result += c;
    }
  }
  return result + "\"";
}

std::string alternatives(std::span<const std::string_view> names) {
  std::string result;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) result += i + 1 == names.size() ? " or " : ", ";
    result += quoted_text(names[i]);
  }
  return result;
}

}  // namespace proofmass::detail
