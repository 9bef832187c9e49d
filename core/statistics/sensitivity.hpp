#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/statistics/correlation.hpp"

namespace proofmass {

/// Share of an output's variance that goes with one input alone (first-order Sobol index).
struct FirstOrderIndex {
  /// 1 − (mean square within bins)/(mean square of all), which has no bias if the input has no
  /// influence; then it is below 0 as often as above.
  double index = 0.0;
  double standard_error = 0.0;
  /// Level that an input without influence exceeds with probability 5 %, by Fisher's law.
  double noise_level = 0.0;
  std::size_t num_bins = 0;
};

/// Below so many values no sensitivity can be told.
inline constexpr std::size_t sensitivity_values_min = 16;

/// Estimates a first-order index from runs as they are, each with all of its inputs drawn anew: the
/// input's values are cut into bins of equal counts, and the output's variance is split into that
/// of the bins' means and that within them (the correlation ratio of [Pearson1905] with Kelley's
/// correction [Kelley1935]).
///
/// The number of bins is ½√n, from 4 to 64. What the output's conditional mean does inside a bin is
/// missed: of an input that is uniform a share 1/bins² of the index if the output is linear in it,
/// 4/bins² if it goes as |x|, as |error| often does, and 5/bins² as x²: up to a fifth with 100
/// values.
///
/// @returns Empty below sensitivity_values_min or if a column does not vary.
/// @throws InvalidArgument if sizes differ or a value is not finite.
[[nodiscard]] std::optional<FirstOrderIndex> first_order_index(std::span<const double> input,
                                                               std::span<const double> output);

/// How one output depends on one input.
struct Sensitivity {
  std::size_t input = 0;  ///< Index of the column.
  Correlation linear;
  Correlation rank;
  FirstOrderIndex first_order;
};

/// A column of values in run order.
using Column = std::span<const double>;

/// For each output, its sensitivity to each input that varies, largest first-order index first.
/// Empty for an output that does not vary. Columns of a campaign: for inputs the drawn_names(), for
/// outputs errors and |errors| of the parameters, over the runs that have an estimate.
///
/// Takes some 0.1 s for a million runs, an input and an output.
///
/// @throws InvalidArgument if columns differ in size, have too few values or one is not finite.
[[nodiscard]] std::vector<std::vector<Sensitivity>> sensitivities(std::span<const Column> inputs,
                                                                  std::span<const Column> outputs,
                                                                  double confidence);

}  // namespace proofmass
