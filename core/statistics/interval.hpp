#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"

namespace proofmass {

/// Contains the true value with probability `confidence`, the rest split evenly on both sides.
struct Interval {
  double lower = 0.0;
  double upper = 0.0;
  double confidence = 0.0;  ///< In (0, 1).

  bool operator==(const Interval&) const = default;
};

/// The confidence of every interval that a user did not choose.
inline constexpr double default_confidence = 0.95;

/// Of the mean, by Student's law: exact for normal values, close for others from some 100 on.
/// Empty below two values.
/// @throws InvalidArgument unless 0 < confidence < 1; so do all below.
[[nodiscard]] std::optional<Interval> mean_interval(const Moments& moments, double confidence);
/// True if values of this skewness are too few for the interval of their mean: Student's law holds
/// up to √n/5 [Cochran1977]. Chance makes that of a sample larger by two standard deviations,
/// 2√(6/n).
[[nodiscard]] bool is_too_skewed(double skewness, std::uint64_t num_values);

/// Of the standard deviation s, by the kurtosis that the values have [Bonett2006]: for any law with
/// a fourth moment, the better the more values. With z the quantile of the normal law and γ₄ the
/// kurtosis, at least 1,
///
///     ln σ² in ln c s² ± z c √((γ₄ − (n − 3)/n)/(n − 1)),      c = n/(n − z)
///
/// where γ₄ = 3 + G2 instead of Bonett's estimate about a trimmed mean; README.md gives the
/// coverage. Empty below five values, and unless n > z.
[[nodiscard]] std::optional<Interval> deviation_interval(const Moments& moments, double confidence);

/// Of a percentile, by order statistics, for any continuous law. Neighbouring order statistics are
/// interpolated [Nyblom1992], so that the coverage is near `confidence` and not above it by up to
/// the probability of one more value. Empty if no order statistic is a bound: the 99th percentile
/// needs 368 values for 95 %.
///
/// @param ascending  From sorted().
/// @param level      In (0, 1).
[[nodiscard]] std::optional<Interval> percentile_interval(std::span<const double> ascending,
                                                          double level, double confidence);

/// Resamples behind one interval of bootstrap_deviation_interval(). With another key its lower end
/// would move by some 2 % of its width, its upper one by 3 to 5 %, the more the longer the tail
/// (measured, standard deviations).
inline constexpr std::size_t num_resamples = 1000;

/// Most groups of values that are resampled.
inline constexpr std::size_t num_bootstrap_groups_max = 1024;

/// Of the standard deviation for values of any law with a fourth moment: bootstrap, bias-corrected
/// and accelerated (BCa) [Efron1987]. README.md has the measured coverage; use it from 200
/// values on.
///
/// Above num_bootstrap_groups_max values it is groups of consecutive ones that are drawn, of equal
/// size up to one, through their sums. The values are independent, so this has the same law, and
/// the time stays some 5 ms for a million values. Draws are Philox blocks under a fixed key: a
/// pure function of the values and their order.
///
/// @returns Empty below three values, and where so few differ that resamples without them reach its
///          lower end; a single point if all values are equal.
/// @throws InvalidArgument also if a value is not finite.
[[nodiscard]] std::optional<Interval> bootstrap_deviation_interval(std::span<const double> values,
                                                                   double confidence);

/// Of a probability, from `num_hits` events in `num_runs` > 0: exact and conservative
/// (Clopper-Pearson).
[[nodiscard]] Interval probability_interval(double num_hits, double num_runs, double confidence);

/// Of a probability, one-sided: each bound holds by itself with this confidence. Exact and
/// conservative (Clopper-Pearson).
/// @pre 0 ≤ num_hits ≤ num_runs, num_runs > 0.
[[nodiscard]] Interval probability_bounds(double num_hits, double num_runs, double confidence);

}  // namespace proofmass
