#include "core/statistics/interval.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <ranges>
#include <vector>

#include "core/error.hpp"
#include "core/math/elementary.hpp"
#include "core/random/stream.hpp"
#include "core/statistics/detail/check.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass {
namespace {

/// Largest r ≥ 1 with P(x₍r₎ ≤ percentile) = P(Bin(n, level) ≥ r) ≥ confidence; 0 if there is none.
std::size_t lower_rank(std::size_t n, double level, double confidence) {
  const auto ranks = std::views::iota(std::size_t{1}, n + 1);
  const auto is_bound = [&](std::size_t r) {
    return binomial_at_least(static_cast<double>(r), static_cast<double>(n), level) >= confidence;
  };
  return static_cast<std::size_t>(std::ranges::partition_point(ranks, is_bound) - ranks.begin());
}

/// @param tail        Left beyond each end.
/// @param confidence  What the interval is called.
Interval clopper_pearson(double num_hits, double num_runs, double tail, double confidence) {
  detail::check_fraction("confidence", confidence);
  PROOFMASS_EXPECT(num_hits >= 0.0 && num_hits <= num_runs && num_runs > 0.0);
  const double misses = num_runs - num_hits;
  return {.lower = num_hits == 0.0 ? 0.0 : beta_quantile(tail, num_hits, misses + 1.0),
          .upper = misses == 0.0 ? 1.0 : beta_quantile(1.0 - tail, num_hits + 1.0, misses),
          .confidence = confidence};
}

// Lower bound of a percentile, one-sided. Of the r values below the percentile the nearest lies an
// exponential distance of rate r/level from it, of those above the nearest one of rate
// (n − r)/(1 − level); the weight makes P(bound ≤ percentile) = confidence under this law.
std::optional<OrderPlace> lower_place(std::size_t n, double level, double confidence) {
  const std::size_t rank = lower_rank(n, level, confidence);
  if (rank == 0) return std::nullopt;
  if (rank == n) return OrderPlace{.from = n - 1, .to = n - 1};
  const auto r = static_cast<double>(rank);
  const auto count = static_cast<double>(n);
  const double too_much = binomial_at_least(r, count, level) - confidence;
  const double too_little = confidence - binomial_at_least(r + 1.0, count, level);
  const double below = r * (1.0 - level) * too_little;
  const double above = (count - r) * level * too_much;
  return OrderPlace{.from = rank - 1, .to = rank, .weight = above / (above + below)};
}

constexpr std::uint64_t bootstrap_key = 1987;

/// Count and sums of d and d² of some values, d being the difference to the mean of all.
struct Group {
  double count = 0.0;
  double sum = 0.0;
  double squares = 0.0;

  void operator+=(const Group& other) {
    count += other.count;
    sum += other.sum;
    squares += other.squares;
  }
  /// 0 where what is left of the squares is within their rounding.
  [[nodiscard]] double standard_deviation() const {
    const double rest = squares - sum * sum / count;
    const double rounding = count * std::numeric_limits<double>::epsilon() * squares;
    return rest > rounding ? std::sqrt(rest / (count - 1.0)) : 0.0;
  }
};

/// @param scale  Of the differences.
std::vector<Group> groups_of(std::span<const double> values, double mean, double scale) {
  const std::size_t count = values.size();
  std::vector<Group> groups(std::min(count, num_bootstrap_groups_max));
  std::size_t current = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (i == (current + 1) * count / groups.size()) ++current;
    const double difference = (values[i] - mean) * scale;
    groups[current] += {1.0, difference, difference * difference};
  }
  return groups;
}

// Each resample draws as many groups as there are, with replacement, four from a block.
std::vector<double> resampled_deviations(std::span<const Group> groups) {
  std::vector<double> deviations(num_resamples);
  for (std::size_t i = 0; i < num_resamples; ++i) {
    const RandomStream stream(bootstrap_key, RunIndex{i}, stream_id("statistics/bootstrap"));
    Group resample;
    RandomBlock block{};
    for (std::size_t drawn = 0; drawn < groups.size(); ++drawn) {
      if (drawn % 4 == 0) block = stream.block(static_cast<std::uint32_t>(drawn / 4));
      resample += groups[(std::uint64_t{block[drawn % 4]} * groups.size()) >> 32];
    }
    deviations[i] = resample.standard_deviation();
  }
  std::sort(deviations.begin(), deviations.end());
  return deviations;
}

/// Φ⁻¹ of the fraction of resamples below the estimate: twice the median's bias, in deviations.
double bias_correction(const std::vector<double>& ascending, double estimate) {
  const auto [first, last] = std::equal_range(ascending.begin(), ascending.end(), estimate);
  const auto below = static_cast<double>(first - ascending.begin());
  const auto equal = static_cast<double>(last - first);
  const auto count = static_cast<double>(ascending.size());
  // Half a resample from either end, where the fraction says no more than that.
  const double fraction = std::clamp((below + 0.5 * equal) / count, 0.5 / count, 1.0 - 0.5 / count);
  return inverse_normal(fraction);
}

/// A sixth of the skewness of the estimates that leave one group out.
double acceleration(std::span<const Group> groups, const Group& all) {
  std::vector<double> left_out;
  left_out.reserve(groups.size());
  for (const Group& group : groups) {
    const Group rest{all.count - group.count, all.sum - group.sum, all.squares - group.squares};
    left_out.push_back(rest.standard_deviation());
  }
  const double mean = compensated_sum(left_out) / static_cast<double>(left_out.size());
  double largest = 0.0;
  for (const double value : left_out) largest = std::max(largest, std::abs(mean - value));
  if (largest <= 0.0) return 0.0;
  const double scale = scale_of(largest);  // The ratio has no unit.
  CompensatedSum squares, cubes;
  for (const double value : left_out) {
    const double difference = (mean - value) * scale;
    squares.add(difference * difference);
    cubes.add(difference * difference * difference);
  }
  return cubes.value() / (6.0 * squares.value() * std::sqrt(squares.value()));
}

}  // namespace

std::optional<Interval> bootstrap_deviation_interval(std::span<const double> values,
                                                     double confidence) {
  detail::check_fraction("confidence", confidence);
  detail::check_values("values", values, 0);
  if (values.size() < 3) return std::nullopt;
  const double mean = compensated_sum(values) / static_cast<double>(values.size());
  double largest = 0.0;
  for (const double value : values) largest = std::max(largest, std::abs(value - mean));
  const double scale = scale_of(largest);
  if (scale == 0.0) return Interval{0.0, 0.0, confidence};
  const std::vector<Group> groups = groups_of(values, mean, scale);
  Group all;
  for (const Group& group : groups) all += group;
  const double estimate = all.standard_deviation();
  if (estimate <= 0.0) return Interval{0.0, 0.0, confidence};

  const std::vector<double> deviations = resampled_deviations(groups);
  const double bias = bias_correction(deviations, estimate);
  const double rate = acceleration(groups, all);
  const auto bound = [&](double probability) {
    const double shifted = bias + inverse_normal(probability);
    return percentile(deviations, normal_cumulative(bias + shifted / (1.0 - rate * shifted))) /
           scale;
  };
  const double lower = bound(0.5 - 0.5 * confidence);
  // Values that differ have a deviation: 0 is that of resamples without those far off.
  if (lower <= 0.0) return std::nullopt;
  return Interval{lower, bound(0.5 + 0.5 * confidence), confidence};
}

std::optional<Interval> mean_interval(const Moments& moments, double confidence) {
  detail::check_fraction("confidence", confidence);
  if (moments.count < 2) return std::nullopt;
  const auto n = static_cast<double>(moments.count);
  const double quantile = student_quantile(0.5 + 0.5 * confidence, n - 1.0);
  const double half_width = quantile * moments.standard_deviation / std::sqrt(n);
  return Interval{moments.mean - half_width, moments.mean + half_width, confidence};
}

bool is_too_skewed(double skewness, std::uint64_t num_values) {
  const auto n = static_cast<double>(num_values);
  return std::abs(skewness) > std::sqrt(n) / 5.0 + 2.0 * std::sqrt(6.0 / n);
}

std::optional<Interval> deviation_interval(const Moments& moments, double confidence) {
  detail::check_fraction("confidence", confidence);
  const double z = inverse_normal(0.5 + 0.5 * confidence);
  const auto n = static_cast<double>(moments.count);
  if (n < 5.0 || n <= z) return std::nullopt;
  const double kurtosis = std::max(1.0, 3.0 + moments.excess_kurtosis);
  const double correction = n / (n - z);
  const double half_width =
      z * correction * std::sqrt((kurtosis - (n - 3.0) / n) / (n - 1.0));  // Of ln σ².
  const double centre = std::sqrt(correction) * moments.standard_deviation;
  return Interval{centre * exponential(-0.5 * half_width), centre * exponential(0.5 * half_width),
                  confidence};
}

std::optional<Interval> percentile_interval(std::span<const double> ascending, double level,
                                            double confidence) {
  detail::check_fraction("level", level);
  detail::check_fraction("confidence", confidence);
  const std::size_t n = ascending.size();
  const double one_sided = 0.5 + 0.5 * confidence;
  const std::optional<OrderPlace> from_below = lower_place(n, level, one_sided);
  // The upper bound is the lower one of the values turned round.
  const std::optional<OrderPlace> from_above = lower_place(n, 1.0 - level, one_sided);
  if (!from_below || !from_above) return std::nullopt;
  return Interval{
      from_below->between(ascending[from_below->from], ascending[from_below->to]),
      from_above->between(ascending[n - 1 - from_above->from], ascending[n - 1 - from_above->to]),
      confidence};
}

Interval probability_interval(double num_hits, double num_runs, double confidence) {
  return clopper_pearson(num_hits, num_runs, 0.5 - 0.5 * confidence, confidence);
}

Interval probability_bounds(double num_hits, double num_runs, double confidence) {
  return clopper_pearson(num_hits, num_runs, 1.0 - confidence, confidence);
}

}  // namespace proofmass
