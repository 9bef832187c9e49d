#include "proto/text/visible_text.hpp"

#include <fmt/format.h>
#include <utf8.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <exception>
#include <span>
#include <utility>

namespace proofmass::wire {
namespace {

/// Characters of one kind, both ends among them.
struct CodeRange {
  char32_t first;
  char32_t last;
};

bool is_in(std::span<const CodeRange> ranges, char32_t code) {
  return std::ranges::any_of(
      ranges, [&](const CodeRange& range) { return code >= range.first && code <= range.last; });
}

// Control characters and those that turn the direction of writing.
constexpr std::array<CodeRange, 6> dangerous{{{0x0, 0x1f},
                                              {0x7f, 0x9f},
                                              {0x61c, 0x61c},
                                              {0x200e, 0x200f},
                                              {0x2028, 0x202e},
                                              {0x2066, 0x2069}}};

std::string escaped(const Character& character, std::string_view bytes) {
  if (!character.is_valid) {
    return fmt::format("\\x{:02x}", static_cast<unsigned char>(bytes.front()));
  }
  if (character.code == U'\n') return "\\n";
  if (character.code == U'\r') return "\\r";
  if (character.code == U'\t') return "\\t";
  return fmt::format("\\u{:04x}", static_cast<std::uint32_t>(character.code));
}

// Marks above and below the letter before, joiners and selectors of variants.
constexpr std::array<CodeRange, 7> combining{{{0x300, 0x36f},
                                              {0x483, 0x489},
                                              {0x1ab0, 0x1aff},
                                              {0x1dc0, 0x1dff},
                                              {0x200b, 0x200d},
                                              {0x20d0, 0x20ff},
                                              {0xfe00, 0xfe0f}}};
// Hangul, CJK, full-width forms and pictographs.
constexpr std::array<CodeRange, 10> wide{{{0x1100, 0x115f},
                                          {0x2e80, 0x303e},
                                          {0x3041, 0x4dbf},
                                          {0x4e00, 0xa4cf},
                                          {0xac00, 0xd7a3},
                                          {0xf900, 0xfaff},
                                          {0xfe30, 0xfe6f},
                                          {0xff00, 0xff60},
                                          {0xffe0, 0xffe6},
                                          {0x1f300, 0x1faff}}};
constexpr CodeRange wide_planes{0x20000, 0x3fffd};

std::size_t width_of(char32_t code) {
  if (is_in(combining, code)) return 0;
  return is_in(wide, code) || is_in({&wide_planes, 1}, code) ? 2 : 1;
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
    const bool is_shown = character.is_valid && !is_in(dangerous, character.code);
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

std::string markup_text(std::string_view text) {
  using Entity = std::pair<char, std::string_view>;
  static constexpr std::array<Entity, 5> entities{
      {{'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}, {'\'', "&#39;"}}};
  std::string markup;
  for (const char character : visible_text(text)) {
    const auto* const entity = std::ranges::find(entities, character, &Entity::first);
    markup += entity == entities.end() ? std::string(1, character) : std::string(entity->second);
  }
  return markup;
}

std::size_t display_width(std::string_view text) {
  std::size_t width = 0;
  while (!text.empty()) {
    const Character character = first_character(text);
    width += width_of(character.code);
    text.remove_prefix(character.size);
  }
  return width;
}

std::string shortened(std::string_view text, std::size_t width) {
  std::size_t end = 0;         // Of what fits.
  std::size_t end_if_cut = 0;  // Of what leaves room for the mark.
  std::size_t taken = 0;
  while (end < text.size()) {
    const Character character = first_character(text.substr(end));
    taken += width_of(character.code);
    if (taken > width) return std::string(text.substr(0, end_if_cut)) + "…";
    end += character.size;
    if (taken < width) end_if_cut = end;
  }
  return std::string(text);
}

void say(std::string_view text) noexcept {
  try {
    say_on(stderr, visible_lines(text));
  } catch (const std::exception&) {
    // Without memory nothing can be made visible.
  }
}

void say_on(std::FILE* stream, std::string_view text) noexcept {
  (void)std::fwrite(text.data(), 1, text.size(), stream);
}

}  // namespace proofmass::wire
