#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"

namespace proofmass {

/// Two-sided p-value of Wilcoxon's signed-rank test of pairs, those without a difference left out:
/// are differences symmetric about 0? Exact up to 50 pairs without equal ones, else by the normal
/// law.
/// @throws InvalidArgument if there is no difference or one is not finite.
[[nodiscard]] double rank_test_p_value(std::vector<double> differences);

/// Of a mean or a difference of means, for Student's law; 0 if nothing varies.
struct StandardError {
  double value = 0.0;
  double degrees = 1.0;  ///< Of freedom.
};

/// Student's t, two-sided: is a mean 0?
[[nodiscard]] double student_p_value(double mean, const StandardError& error);

/// With one scatter for both, which two campaigns have if nothing changes.
[[nodiscard]] StandardError pooled_error(const Moments& first, const Moments& second);

/// Two campaigns with draws of their own; differences are second − first.
struct UnpairedComparison {
  double mean_difference = 0.0;
  /// Of the difference, as wide as the wider one by the two standard errors of compare_means();
  /// empty if neither varies.
  std::optional<Interval> interval;
  double mean_p_value = 1.0;  ///< The larger one by these, two-sided: are the means equal?
  double distance = 0.0;      ///< Largest difference of the distribution functions.
  /// Kolmogorov and Smirnov's test: one law? Exact if the product of both counts is at most
  /// 4 million, else by the limiting law, which is conservative.
  double law_p_value = 1.0;
  /// Of a change: mean_p_value; with fewer than num_welch_min values on a side the larger of both,
  /// as a test of means then finds changes that are not there, the more the less normal the values
  /// are.
  double p_value = 1.0;
};

/// Fewest values on either side that a test of means is trusted with alone; README.md has the
/// measurement.
inline constexpr std::size_t num_welch_min = 100;

/// @throws InvalidArgument if one has below two values or a value is not finite; confidence must
/// be in (0, 1).
[[nodiscard]] UnpairedComparison compare_unpaired(std::span<const double> first,
                                                  std::span<const double> second,
                                                  double confidence);

/// compare_unpaired() by the means alone: `distance` is 0 and `law_p_value` 1. By Student's law
/// with two standard errors: Welch's, with a scatter of its own for each, and pooled_error(). By
/// the first one alone, a small campaign that happens to have no rare value would be too sure of
/// its mean; by the second one, a small campaign that scatters more.
[[nodiscard]] UnpairedComparison compare_means(const Moments& first, const Moments& second,
                                               double confidence);

/// Two-sided p-value of the sign test, exact: as many larger as smaller?
[[nodiscard]] double sign_test_p_value(std::size_t num_larger, std::size_t num_smaller);

/// P-values such that comparing each with α errs in any of them with probability α at most
/// [Holm1979]; in the given order.
/// @param weights  Above 0, one for each p-value, or none for equal ones: a test with twice the
///                 weight finds effects at twice the p-value.
[[nodiscard]] std::vector<double> holm_adjusted(std::span<const double> p_values,
                                                std::span<const double> weights = {});

}  // namespace proofmass
