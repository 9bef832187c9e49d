#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/statistics/comparison.hpp"
#include "core/statistics/moments.hpp"

namespace proofmass {

// Do the errors of two campaigns differ? Three tests: of their location (bias), of their scale
// (scatter about the bias) and of their tail (how many are far out). README.md has their power.

/// Where the tail begins: at twice the root mean square of all errors of both campaigns, beyond
/// which 4.6 % of normal ones lie. It is the same whichever errors are whose, so that the counts
/// beyond it follow the hypergeometric law if both campaigns have one law.
[[nodiscard]] double tail_limit(std::span<const double> first, std::span<const double> second);

/// How many |errors| are above a limit.
[[nodiscard]] std::size_t num_beyond(std::span<const double> errors, double limit);

/// How probable such differences are by chance alone, two-sided.
struct ChangePValues {
  double location = 1.0;
  double scale = 1.0;
  double tail = 1.0;
};

/// Of campaigns with draws of their own, two errors at least each. The tail: Fisher's exact test of
/// the counts beyond tail_limit(). From num_welch_min errors on either side on, compare_means() of
/// the errors, and Student's t with one scatter of their distances from the mean, with the scatter
/// that holds for skew laws, too (Levene's test; README.md compares it with others). Of fewer
/// errors compare_unpaired() of the errors and of |error − mean of both campaigns|: a large change
/// of the bias then shows as one of the scale too.
[[nodiscard]] ChangePValues compare_errors(std::span<const double> first,
                                           std::span<const double> second);

/// Of campaigns of the same draws, run by run: Student's t of the differences of the errors and of
/// their distances from the mean of their campaign, with the scatter that holds for skew laws,
/// below num_welch_min pairs the larger p-value of it and Wilcoxon's signed ranks; and the sign
/// test of the pairs of which one error is in the tail (McNemar).
/// @pre As many errors in both, one at least.
[[nodiscard]] ChangePValues compare_paired_errors(std::span<const double> first,
                                                  std::span<const double> second);

/// The smallest factor by which the scatter of the second campaign may be larger and is found with
/// this probability by compare_errors(), if the p-values of so many parameters are adjusted
/// together. It gives "no change" a meaning. Empty if no factor is found so, and below
/// num_welch_min errors on a side.
inline constexpr double finding_probability = 0.9;
[[nodiscard]] std::optional<double> smallest_scale_factor(std::span<const double> first,
                                                          std::span<const double> second,
                                                          std::size_t num_parameters);
/// The factor that compare_paired_errors() would have found, whatever has changed; empty of fewer
/// than ten pairs, and of pairs that are equal but for a factor.
[[nodiscard]] std::optional<double> smallest_paired_scale_factor(std::span<const double> first,
                                                                 std::span<const double> second,
                                                                 std::size_t num_parameters);

/// Corrects the p-values of all parameters together by holm_adjusted() with weights: location has
/// five tenths, scale four and tail one.
[[nodiscard]] std::vector<ChangePValues> adjusted_changes(std::span<const ChangePValues> changes);

/// P-value of Fisher's exact test: of two groups of `num_first` and `num_second`, of which
/// `tail_first` and `tail_second` are in the tail. Two-sided, by the probabilities that are at most
/// the one of the counts that are seen.
struct TailCounts {
  std::uint64_t num_first = 0;
  std::uint64_t tail_first = 0;
  std::uint64_t num_second = 0;
  std::uint64_t tail_second = 0;
};
[[nodiscard]] double fisher_exact_p_value(const TailCounts& counts);

}  // namespace proofmass
