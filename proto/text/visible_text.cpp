#include "proto/text/visible_text.hpp"

#include <fmt/format.h>
#include <utf8.h>

#include <algorithm>
#include <array>
#include <cstdint>

namespace proofmass::wire {
namespace {

/// Characters of one kind, both ends among them.
struct CodeRange {
  char32_t first;
  char32_t last;
};

// Control characters and those that turn the direction of writing.
constexpr std::array<CodeRange, 6> dangerous{{{0x0, 0x1f},
                                              {0x7f, 0x9f},
                                              {0x61c, 0x61c},
                                              {0x200e, 0x200f},
                                              {0x2028, 0x202e},
                                              {0x2066, 0x2069}}};

bool is_dangerous(char32_t code) {
  return std::ranges::any_of(
      dangerous, [&](const CodeRange& range) { return code >= range.first && code <= range.last; });
}

std::string escaped(const Character& character, std::string_view bytes) {
  if (!character.is_valid) {
    return fmt::format("\\x{:02x}", static_cast<unsigned char>(bytes.front()));
  }
  if (character.code == U'\n') return "\\n";
  if (character.code == U'\r') return "\\r";
  if (character.code == U'\t') return "\\t";
  return fmt::format("\\u{:04x}", static_cast<std::uint32_t>(character.code));
}

}  // namespace

Character first_character(std::string_view text) {
  try {
    const char* at = text.data();
    const char32_t code = utf8::next(at, text.data() + text.size());
    return {.code = code, .size = static_cast<std::size_t>(at - text.data()), .is_valid = true};
  } catch (const utf8::exception&) {
    return {};
  }
}

std::string visible_text(std::string_view text) {
  std::string visible;
  while (!text.empty()) {
    const Character character = first_character(text);
    const std::string_view bytes = text.substr(0, character.size);
    const bool is_shown = character.is_valid && !is_dangerous(character.code);
    visible += is_shown ? std::string(bytes) : escaped(character, bytes);
    text.remove_prefix(character.size);
  }
  return visible;
}

std::string visible_lines(std::string_view text) {
  std::string visible;
  while (!text.empty()) {
    const std::size_t size = std::min(text.find('\n'), text.size());
    visible += visible_text(text.substr(0, size));
    if (size < text.size()) visible += '\n';
    text.remove_prefix(std::min(size + 1, text.size()));
  }
  return visible;
}

}  // namespace proofmass::wire
