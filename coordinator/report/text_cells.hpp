#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {

using wire::display_width;
using wire::shortened;

/// Text filled up with spaces on the right or left to `width` columns of a terminal.
[[nodiscard]] std::string left_aligned(std::string_view text, std::size_t width);
[[nodiscard]] std::string right_aligned(std::string_view text, std::size_t width);

/// Text broken between words to lines of at most 80 columns, from the second one on after `indent`
/// spaces. No end of the last line.
[[nodiscard]] std::string wrapped(const std::string& text, std::size_t indent);

/// Two parts of a line with a space between; below each other, the second behind `margin` spaces,
/// if they take more than the 80 columns of a terminal.
[[nodiscard]] std::string line_of(std::string_view first, std::string_view second,
                                  std::size_t margin);

/// A column of a table: text stands left, numbers right.
struct TextColumn {
  std::string_view title;
  std::size_t width;  ///< At least one space of it separates the column from the next.
  bool is_text = false;
  /// Heading above this column and the next ones with the same one, up to a vertical line.
  std::string_view group = {};
  bool is_after_line = false;  ///< A vertical line separates it from the column before it.
};

/// The columns, widened for the longest text of each as far as a line of `line_width_max` columns
/// of a terminal allows. The first columns come first; none becomes narrower.
/// @param rows  As many cells each as there are columns.
[[nodiscard]] std::vector<TextColumn> widened(std::span<const TextColumn> columns,
                                              std::span<const std::vector<std::string>> rows,
                                              std::size_t line_width_max);

/// What happens to a cell that is wider than its column.
enum class WideCell : std::uint8_t { shorten, keep };

/// A line of a table, of as many cells as there are columns.
[[nodiscard]] std::string table_row(std::span<const TextColumn> columns,
                                    std::span<const std::string> cells,
                                    WideCell wide_cell = WideCell::shorten);

/// The horizontal line below the titles, up to the last one; the vertical lines cross it.
[[nodiscard]] std::string table_rule(std::span<const TextColumn> columns);

/// The groups, if there are any, the titles, and table_rule().
[[nodiscard]] std::string table_heading(std::span<const TextColumn> columns);

/// `count` times the line ─.
[[nodiscard]] std::string horizontal_rule(std::size_t count);

/// A number ≥ 0 with three significant digits: `0.361`, `7.53`, `49.2`, `1240`; from a million on
/// and below a thousandth `1.2e+06`, which is at most seven characters below 1e99.
[[nodiscard]] std::string measured_figure(double value);

/// measured_figure() of any number, with a minus sign if it is below 0.
[[nodiscard]] std::string signed_figure(double value);

/// A number ≥ 0 given by somebody: the same without zeros that say nothing, `7.3`, `2000`.
[[nodiscard]] std::string given_figure(double value);

/// For people: `42 s`, `3 min 20 s`, `5 h 10 min`, `12 d 4 h`.
[[nodiscard]] std::string duration_text(double seconds);

}  // namespace proofmass::coordinator
