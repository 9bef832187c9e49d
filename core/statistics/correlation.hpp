#pragma once

#include <optional>
#include <span>

#include "core/statistics/interval.hpp"

namespace proofmass {

struct Correlation {
  double coefficient = 0.0;  ///< In [-1, 1].
  Interval interval;
};

/// Linear correlation of two columns (Pearson). The interval takes atanh r as normal with variance
/// 1/(n − 3) (Fisher), which holds for jointly normal columns; for others trust
/// rank_correlation().
///
/// @returns Empty below four values or if a column does not vary.
/// @throws InvalidArgument if sizes differ, a value is not finite or confidence is not in (0, 1).
[[nodiscard]] std::optional<Correlation> linear_correlation(std::span<const double> x,
                                                            std::span<const double> y,
                                                            double confidence);

/// Correlation of the ranks (Spearman), equal values sharing their average rank; for any monotone
/// relation. The interval takes atanh r as normal with variance (1 + r²/2)/(n − 3)
/// [BonettWright2000]. Conditions as linear_correlation().
[[nodiscard]] std::optional<Correlation> rank_correlation(std::span<const double> x,
                                                          std::span<const double> y,
                                                          double confidence);

/// rank_correlation() from average_ranks() of both columns, for a column that meets many others.
[[nodiscard]] std::optional<Correlation> correlation_of_ranks(std::span<const double> x_ranks,
                                                              std::span<const double> y_ranks,
                                                              double confidence);

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
