#include "core/statistics/bootstrap.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/random/normal.hpp"
#include "core/random/stream.hpp"
#include "core/statistics/detail/check.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/order.hpp"
#include "core/statistics/sum.hpp"

namespace proofmass {
namespace {

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
  [[nodiscard]] double standard_deviation() const {
    return std::sqrt(std::max(squares - sum * sum / count, 0.0) / (count - 1.0));
  }
};

Group total_of(const std::vector<Group>& groups) {
  Group total;
  for (const Group& group : groups) total += group;
  return total;
}

std::vector<Group> group_values(std::span<const double> values, double mean) {
  const std::size_t num_groups = std::min(values.size(), num_bootstrap_groups_max);
  std::vector<Group> groups(num_groups);
  for (std::size_t g = 0; g < num_groups; ++g) {
    const std::size_t end = (g + 1) * values.size() / num_groups;
    for (std::size_t i = g * values.size() / num_groups; i < end; ++i) {
      const double difference = values[i] - mean;
      groups[g] += {1.0, difference, difference * difference};
    }
  }
  return groups;
}

// Each resample draws as many groups as there are, with replacement, four from a block.
std::vector<double> resampled_deviations(const std::vector<Group>& groups) {
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
double acceleration(const std::vector<Group>& groups) {
  const Group total = total_of(groups);
  std::vector<double> left_out;
  left_out.reserve(groups.size());
  for (const Group& group : groups) {
    const Group rest{total.count - group.count, total.sum - group.sum,
                     total.squares - group.squares};
    left_out.push_back(rest.standard_deviation());
  }
  const double mean = compensated_sum(left_out) / static_cast<double>(left_out.size());
  double largest = 0.0;
  for (const double value : left_out) largest = std::max(largest, std::abs(mean - value));
  if (largest <= 0.0) return 0.0;
  // The ratio has no unit. With the largest difference near 1, exactly by a power of two, no cube
  // leaves the range of a double.
  const int exponent = std::ilogb(largest);
  CompensatedSum squares, cubes;
  for (const double value : left_out) {
    const double difference = std::scalbn(mean - value, -exponent);
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
  const std::vector<Group> groups = group_values(values, mean);
  const double estimate = total_of(groups).standard_deviation();
  if (estimate <= 0.0) return Interval{0.0, 0.0, confidence};

  const std::vector<double> deviations = resampled_deviations(groups);
  const double bias = bias_correction(deviations, estimate);
  const double rate = acceleration(groups);
  const auto bound = [&](double probability) {
    const double shifted = bias + inverse_normal(probability);
    return percentile(deviations, normal_cumulative(bias + shifted / (1.0 - rate * shifted)));
  };
  return Interval{bound(0.5 - 0.5 * confidence), bound(0.5 + 0.5 * confidence), confidence};
}

}  // namespace proofmass
