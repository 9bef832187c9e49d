#include "coordinator/report/text_cells.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace proofmass::coordinator {
namespace {

std::string spaces(std::size_t width, std::string_view text) {
  const std::size_t taken = text_width(text);
  return std::string(width > taken ? width - taken : 0, ' ');
}

}  // namespace

// Every byte of UTF-8 starts a character but those of the form 10xxxxxx.
std::size_t text_width(std::string_view text) {
  const auto starts = [](char byte) { return (static_cast<unsigned char>(byte) & 0xc0) != 0x80; };
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), starts));
}

std::string left_aligned(std::string_view text, std::size_t width) {
  return std::string(text) + spaces(width, text);
}

std::string right_aligned(std::string_view text, std::size_t width) {
  return spaces(width, text) + std::string(text);
}

std::string centred(std::string_view text, std::size_t width) {
  const std::size_t margin = spaces(width, text).size() / 2;
  return std::string(margin, ' ') + std::string(text);
}

std::string shortened(std::string_view text, std::size_t width) {
  if (text_width(text) <= width) return std::string(text);
  std::size_t size = 0;
  // Every byte that continues a UTF-8 character goes with the one before it.
  for (std::size_t num_characters = 0; size < text.size(); ++size) {
    const bool continues = (static_cast<unsigned char>(text[size]) & 0xc0) == 0x80;
    if (!continues && ++num_characters >= width) break;
  }
  return std::string(text.substr(0, size)) + "…";
}

std::string line_of(std::string_view first, std::string_view second, std::size_t margin) {
  constexpr std::size_t columns_max = 80;
  const bool fits = text_width(first) + 1 + text_width(second) <= columns_max;
  return fits ? fmt::format("{} {}\n", first, second)
              : fmt::format("{}\n{:{}}{}\n", first, "", margin, second);
}

std::string horizontal_rule(std::size_t count) {
  std::string rule;
  for (std::size_t i = 0; i < count; ++i) rule += "─";
  return rule;
}

std::string measured_figure(double value) {
  if (value == 0.0) return "0";
  if (value < 1e-3 || value >= 999'999.5) return fmt::format("{:.1e}", value);
  // Rounding may carry into the next decade: 9.996 is 10.0.
  const double rounded = std::stod(fmt::format("{:.2e}", value));
  const int exponent = static_cast<int>(std::floor(std::log10(rounded)));
  return fmt::format("{:.{}f}", value, std::max(0, 2 - exponent));
}

std::string given_figure(double value) {
  std::string figure = measured_figure(value);
  const bool has_fraction =
      figure.find('.') != std::string::npos && figure.find('e') == std::string::npos;
  if (!has_fraction) return figure;
  figure.erase(figure.find_last_not_of('0') + 1);
  if (figure.back() == '.') figure.pop_back();
  return figure;
}

}  // namespace proofmass::coordinator
