#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace proofmass::coordinator {

/// Characters of UTF-8 text: Δ and ² are one each, as on a terminal.
[[nodiscard]] std::size_t text_width(std::string_view text);

/// Text filled up with spaces on the right or left to `width` characters.
[[nodiscard]] std::string left_aligned(std::string_view text, std::size_t width);
[[nodiscard]] std::string right_aligned(std::string_view text, std::size_t width);
/// Text in the middle of `width` characters, without spaces behind it.
[[nodiscard]] std::string centred(std::string_view text, std::size_t width);

/// Text cut to `width` characters, the last of them `…` if something is missing.
[[nodiscard]] std::string shortened(std::string_view text, std::size_t width);

/// Two parts of a line with a space between; below each other, the second behind `margin` spaces,
/// if they take more than the 80 columns of a terminal.
[[nodiscard]] std::string line_of(std::string_view first, std::string_view second,
                                  std::size_t margin);

/// `count` times the line ─.
[[nodiscard]] std::string horizontal_rule(std::size_t count);

/// A number ≥ 0 with three significant digits: `0.361`, `7.53`, `49.2`, `1240`; from a million on
/// and below a thousandth `1.2e+06`, which is at most seven characters below 1e99.
[[nodiscard]] std::string measured_figure(double value);

/// A number ≥ 0 given by somebody: the same without zeros that say nothing, `7.3`, `2000`.
[[nodiscard]] std::string given_figure(double value);

}  // namespace proofmass::coordinator
