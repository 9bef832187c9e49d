#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/statistics/correlation.hpp"
#include "core/statistics/interval.hpp"

namespace proofmass {

/// Share of an output's variance that goes with one input alone (first-order Sobol index),
/// estimated from runs as they are, each with all of its inputs drawn anew: the outputs in the
/// order of the input are compared with their neighbours [GamboaEtAl2022], whose half squared
/// differences are the variance that the input leaves [Rice1984]. The bias goes as 1/n², so that it
/// can be left out from 100 values on.
struct FirstOrderIndex {
  /// 1 − (mean squared half-difference of neighbours)/variance; for an input without influence it
  /// is below 0 as often as above.
  double index = 0.0;
  double standard_error = 0.0;
  Interval interval;  ///< Not symmetric about the index; its lower end may be below 0.
  /// Kruskal and Wallis' test: does the output depend on the input? It looks at ranks only, so it
  /// errs as often as it says whatever the law of the output.
  double p_value = 1.0;
};

/// Below so many values no sensitivity can be told.
inline constexpr std::size_t sensitivity_values_min = 16;

/// How one output depends on one input.
struct Sensitivity {
  std::size_t input = 0;  ///< Index of the column.
  Correlation linear;
  Correlation rank;
  FirstOrderIndex first_order;
  /// p_value of the index, corrected by holm_adjusted() for all inputs that vary.
  double adjusted_p_value = 1.0;
};

/// A column of values in run order.
using Column = std::span<const double>;

/// For each output, its sensitivity to each input that varies: first those with a corrected p-value
/// below 1 − confidence, by their index, then the others by their p-value. Empty for an output that
/// does not vary. Columns of a campaign: for inputs the drawn_names(), for outputs errors and
/// |errors| of the parameters, over the runs that have an estimate.
///
/// Takes some 0.1 s for a million runs, an input and an output.
///
/// @throws InvalidArgument if columns differ in size, have too few values or one is not finite.
[[nodiscard]] std::vector<std::vector<Sensitivity>> sensitivities(std::span<const Column> inputs,
                                                                  std::span<const Column> outputs,
                                                                  double confidence);

}  // namespace proofmass
