#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/charts/chart.hpp"

namespace proofmass::coordinator {

/// A number as people write it: at most three significant digits, or all of a whole number, U+2212
/// as its minus sign, and powers of ten in superscripts outside of 0.001 to 99,999: `−0.25`,
/// `1244`, `2.5×10⁻⁹`, `10⁶`.
[[nodiscard]] std::string figure_text(double value);

/// A unit in the same spelling: `10⁻⁴ rad` for `1e-4 rad`.
[[nodiscard]] std::string unit_text(std::string_view unit);

/// A place on an axis that has a line and a label.
struct Tick {
  double value = 0.0;
  std::string label;  ///< With as many digits as it takes to tell it from its neighbours.
};

/// Where an axis begins and ends, and its ticks, which are not outside.
struct AxisRange {
  double from = 0.0;
  double to = 1.0;
  std::vector<Tick> ticks = {};
};

/// Steps are 1, 2 or 5 times a power of ten, the smallest with `num_ticks_max` ticks at most.
/// @param axis      Of a linear scale. An end that it does not give is moved outwards to a tick.
/// @param from, to  Of the data. If they are equal, the range is made wider.
/// @param num_ticks_max  2 or more.
[[nodiscard]] AxisRange linear_range(const ChartAxis& axis, double from, double to,
                                     std::size_t num_ticks_max);

/// Ticks are 1, 2 and 5 times powers of ten over less than two of these, and if they are few
/// enough; else powers of ten, every k-th of them with the smallest k for which they are.
/// @param axis      Of a logarithmic scale. An end that it does not give is moved outwards to 1, 2
///                  or 5 times a power of ten.
/// @param from, to  Of the data, above 0.
[[nodiscard]] AxisRange logarithmic_range(const ChartAxis& axis, double from, double to,
                                          std::size_t num_ticks_max);

}  // namespace proofmass::coordinator
