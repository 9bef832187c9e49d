#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "coordinator/table/table.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {

using wire::display_width;
using wire::shortened;

enum class Paint : std::uint8_t { no, yes };

/// What a terminal, or a file in its place, takes.
struct TerminalStyle {
  std::size_t line_width_max = std::numeric_limits<std::size_t>::max();
  Paint paint = Paint::no;
  bool cuts_remarks = false;  ///< Remarks are cut to the line, else they take what they need.
  bool wraps_cells = false;   ///< Text that a column has no room for goes on below, else it is cut.
};

/// Of a text that nobody cuts: lines of at most 80 columns, on a terminal or not.
[[nodiscard]] TerminalStyle document_style(Paint paint);

/// Number of a tone's colour among the 256 of a terminal, or 0 for the terminal's own. Blue and
/// orange can be told apart by colour-blind people, and have a contrast of at least 4:1 on black
/// and on white.
[[nodiscard]] int colour_of(Tone tone);

/// Visible text between the control sequences of its tone; as it is if nothing is painted.
[[nodiscard]] std::string in_tone(std::string_view text, Tone tone, Paint paint);

/// The caption, the rows below their titles, the remarks and the notes; notes are broken to lines
/// of 80 columns. Whatever the texts hold, they are visible.
[[nodiscard]] std::string terminal_text(const Table& table, const TerminalStyle& style = {});

/// Text filled up with spaces on the right to `width` columns of a terminal.
[[nodiscard]] std::string left_aligned(std::string_view text, std::size_t width);

/// Text broken between words, and in longer ones, to lines of at most 80 columns, from the second
/// one on after `indent` spaces; the first one begins at column `begin`. No end of the last line.
[[nodiscard]] std::string wrapped(const std::string& text, std::size_t indent, std::size_t begin);

/// Lines, those of more than 80 columns broken between words. What follows of such a line stands
/// below what it has behind its label, as in `Note      text`, else two columns further right.
[[nodiscard]] std::string fitted(std::string_view text);

}  // namespace proofmass::coordinator
