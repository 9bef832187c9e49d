#include "core/statistics/bootstrap.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/random/normal.hpp"
#include "core/random/stream.hpp"
#include "core/statistics/detail/check.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"

namespace proofmass {
namespace {

constexpr std::uint64_t bootstrap_key = 1987;

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

}  // namespace

void BootstrapGroups::Group::operator+=(const Group& other) {
  count += other.count;
  sum += other.sum;
  squares += other.squares;
}

double BootstrapGroups::Group::standard_deviation() const {
  return std::sqrt(std::max(squares - sum * sum / count, 0.0) / (count - 1.0));
}

BootstrapGroups::BootstrapGroups(std::size_t count, double mean)
    : count_(count), mean_(mean), groups_(std::min(count, num_bootstrap_groups_max)) {}

void BootstrapGroups::add(double value) {
  if (num_added_ == (current_ + 1) * count_ / groups_.size()) ++current_;
  ++num_added_;
  const double difference = value - mean_;
  groups_[current_] += {1.0, difference, difference * difference};
}

BootstrapGroups::Group BootstrapGroups::total() const {
  Group total;
  for (const Group& group : groups_) total += group;
  return total;
}

// Each resample draws as many groups as there are, with replacement, four from a block.
std::vector<double> BootstrapGroups::resampled_deviations() const {
  std::vector<double> deviations(num_resamples);
  for (std::size_t i = 0; i < num_resamples; ++i) {
    const RandomStream stream(bootstrap_key, RunIndex{i}, stream_id("statistics/bootstrap"));
    Group resample;
    RandomBlock block{};
    for (std::size_t drawn = 0; drawn < groups_.size(); ++drawn) {
      if (drawn % 4 == 0) block = stream.block(static_cast<std::uint32_t>(drawn / 4));
      resample += groups_[(std::uint64_t{block[drawn % 4]} * groups_.size()) >> 32];
    }
    deviations[i] = resample.standard_deviation();
  }
  std::sort(deviations.begin(), deviations.end());
  return deviations;
}

/// A sixth of the skewness of the estimates that leave one group out.
double BootstrapGroups::acceleration() const {
  const Group all = total();
  std::vector<double> left_out;
  left_out.reserve(groups_.size());
  for (const Group& group : groups_) {
    const Group rest{all.count - group.count, all.sum - group.sum, all.squares - group.squares};
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

std::optional<Interval> BootstrapGroups::deviation_interval(double confidence) const {
  detail::check_fraction("confidence", confidence);
  const double estimate = total().standard_deviation();
  if (estimate <= 0.0) return Interval{0.0, 0.0, confidence};

  const std::vector<double> deviations = resampled_deviations();
  const double bias = bias_correction(deviations, estimate);
  const double rate = acceleration();
  const auto bound = [&](double probability) {
    const double shifted = bias + inverse_normal(probability);
    return percentile(deviations, normal_cumulative(bias + shifted / (1.0 - rate * shifted)));
  };
  return Interval{bound(0.5 - 0.5 * confidence), bound(0.5 + 0.5 * confidence), confidence};
}

std::optional<Interval> bootstrap_deviation_interval(std::span<const double> values,
                                                     double confidence) {
  detail::check_fraction("confidence", confidence);
  detail::check_values("values", values, 0);
  if (values.size() < 3) return std::nullopt;
  BootstrapGroups groups(values.size(),
                         compensated_sum(values) / static_cast<double>(values.size()));
  for (const double value : values) groups.add(value);
  return groups.deviation_interval(confidence);
}

}  // namespace proofmass
