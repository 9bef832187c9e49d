#pragma once

#include <cstddef>
#include <cstdio>
#include <string>
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

/// Text that is safe on a terminal and takes one line: control characters, those that turn the
/// direction of writing and bytes that are not UTF-8 are written `\n`, `\u202e`, `\xff`. All text
/// of a file or a peer passes through it, or visible_lines(), on its way to a person.
[[nodiscard]] std::string visible_text(std::string_view text);

/// visible_text() of several lines, whose ends stay.
[[nodiscard]] std::string visible_lines(std::string_view text);

/// Visible text that is safe in HTML and SVG, between tags and in an attribute's double quotes:
/// what could begin a tag, an entity or end the quotes is written as an entity.
[[nodiscard]] std::string markup_text(std::string_view text);

/// Columns of a terminal that visible text takes: none for a combining mark, two for an East Asian
/// character or a pictograph.
[[nodiscard]] std::size_t display_width(std::string_view text);

/// Visible text of at most `width` columns, the last a `…` if something is left out.
/// @pre width ≥ 1.
[[nodiscard]] std::string shortened(std::string_view text, std::size_t width);

/// The text of a file without the mark with which Windows programs begin UTF-8.
[[nodiscard]] inline std::string_view without_byte_order_mark(std::string_view text) {
  constexpr std::string_view mark = "\xEF\xBB\xBF";
  return text.starts_with(mark) ? text.substr(mark.size()) : text;
}

/// Tells the user on standard error, as visible_lines(): the text may quote a file or a peer. A
/// failure to write, on a full disk or to a closed terminal, is ignored: answers go to standard
/// output.
void say(std::string_view text) noexcept;

/// Writes to a stream as it is: for displays, which move the cursor.
/// @pre What the text quotes of files and peers has been made visible.
void say_on(std::FILE* stream, std::string_view text) noexcept;

}  // namespace proofmass::wire
