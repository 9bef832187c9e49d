#pragma once

#include <optional>
#include <span>

namespace proofmass {

/// Linear correlation of two columns (Pearson), in [-1, 1].
///
/// @returns Empty below four values or if a column does not vary.
/// @throws InvalidArgument if sizes differ or a value is not finite.
[[nodiscard]] std::optional<double> linear_correlation(std::span<const double> x,
                                                       std::span<const double> y);

/// Correlation of the ranks (Spearman), equal values sharing their average rank; for any monotone
/// relation. Conditions as linear_correlation(), which yields it from average_ranks() of a column
/// that meets many others.
[[nodiscard]] std::optional<double> rank_correlation(std::span<const double> x,
                                                     std::span<const double> y);

/// The straight line through points with the least squares of y − (intercept + slope x).
struct RegressionLine {
  double slope = 0.0;      ///< Unit of y over that of x.
  double intercept = 0.0;  ///< Unit of y; of the line at x = 0.
};

/// Fits the line by central sums, as those of moments.hpp:
///
///     slope = Σ(x − x̄)(y − ȳ) / Σ(x − x̄)²      intercept = ȳ − slope x̄
///
/// What the rounded slope lacks is computed from the residuals and enters the intercept, which else
/// would lose digits where x is far from 0. For magnitudes between 1e-100 and 1e100.
///
/// @returns Empty below two points or if x does not vary.
/// @throws InvalidArgument if sizes differ or a value is not finite.
[[nodiscard]] std::optional<RegressionLine> fit_line(std::span<const double> x,
                                                     std::span<const double> y);

}  // namespace proofmass
