#pragma once

#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

namespace proofmass::coordinator {

/// What a part of a text is painted for. Colour never says anything that the words do not: it only
/// helps to find them.
enum class Tone : std::uint8_t {
  heading,  ///< Titles of a table.
  good,     ///< A requirement that is met, a check that passes.
  bad,      ///< What somebody should look at: an error beyond its objective, a failure, a loss.
  changed,  ///< A significant change, good or bad.
};

/// Number of a tone's colour among the 256 of a terminal, or 0 for the terminal's own. Blue and
/// orange can be told apart by colour-blind people, and have a contrast of at least 4:1 on black
/// and on white.
[[nodiscard]] int colour_of(Tone tone);

/// True if the stream is a terminal that obeys control sequences: TERM is neither unset nor `dumb`.
[[nodiscard]] bool takes_escapes(std::FILE* stream);

/// True if what is written to the stream may be painted, too: NO_COLOR is not set or empty
/// (https://no-color.org).
[[nodiscard]] bool takes_paint(std::FILE* stream);

/// Tables and notes of any command with their verdicts, counts beyond an objective, failures and
/// titles painted. Without the control sequences it is the same text.
///
/// The words decide and not the command, so that what a coordinator answers is painted as well. A
/// name in a file that looks like a verdict may be painted; it can do no more.
/// @param text  Visible, see wire::visible_lines(): it has no control sequence of its own.
[[nodiscard]] std::string painted(std::string_view text);

}  // namespace proofmass::coordinator
