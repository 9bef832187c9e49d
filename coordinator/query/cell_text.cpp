#include "coordinator/query/cell_text.hpp"

#include <array>
#include <charconv>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

/// One text for each type of a cell.
struct TextOf {
  std::string operator()(std::monostate) const { return {}; }
  std::string operator()(std::int64_t value) const { return std::to_string(value); }
  std::string operator()(double value) const { return shortest_text(value); }
  std::string operator()(std::string_view text) const { return std::string(text); }
  std::string operator()(const Blob& blob) const { return blob_text(blob); }
};

}  // namespace

std::string shortest_text(double value) {
  std::array<char, 32> text{};
  const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value);
  PROOFMASS_EXPECT(error == std::errc());
  return {text.data(), end};
}

std::string blob_text(const Blob& blob) {
  static constexpr std::string_view digits = "0123456789abcdef";
  std::string text = "x'";
  for (const char c : blob.bytes) {
    const auto byte = static_cast<unsigned char>(c);
    text += digits[byte >> 4U];
    text += digits[byte & 15U];
  }
  return text + "'";
}

std::string cell_text(const Cell& cell) { return std::visit(TextOf{}, cell); }

bool is_number(const Cell& cell) {
  return std::holds_alternative<std::int64_t>(cell) || std::holds_alternative<double>(cell);
}

}  // namespace proofmass::coordinator
