#include "core/statistics/variance_components.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.hpp"
#include "core/math/elementary.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass {
namespace {

/// Above as many groups the jackknife leaves out several at a time.
constexpr std::size_t num_blocks_max = 1024;

/// Of F beyond it the share within is 0 in any report.
constexpr double log_max = 600.0;

/// Degrees of freedom that are left at least: the kurtosis of few values is not known, and fewer
/// would stretch intervals manyfold for hardly any coverage.
constexpr double degrees_min = 4.0;

/// Fewest groups with a hit, and with a member without one, for which the variance between groups
/// tells how much their members depend on one another.
constexpr std::uint64_t num_telling_groups_min = 10;

}  // namespace

GroupedValues::Block& GroupedValues::Block::operator+=(const Block& other) {
  num_groups += other.num_groups;
  sum += other.sum;
  squares += other.squares;
  within += other.within;
  return *this;
}

void GroupedValues::add(std::span<const double> group) {
  PROOFMASS_EXPECT(group.size() == group_size_ && group_size_ > 1);
  const double mean = compensated_sum(group) / static_cast<double>(group_size_);
  if (!means_) {
    means_.emplace(mean);
    centre_ = mean;
  }
  means_->add(mean);
  double within = 0.0;
  for (const double value : group) within += (value - mean) * (value - mean);
  within_.add(within);
  const double difference = mean - centre_;
  add_to_blocks({1, difference, difference * difference, within});
}

void GroupedValues::add_to_blocks(const Block& group) {
  if (!blocks_.empty() && blocks_.back().num_groups < block_size_) {
    blocks_.back() += group;
    return;
  }
  if (blocks_.size() == num_blocks_max) {
    for (std::size_t i = 0; i < num_blocks_max / 2; ++i) {
      blocks_[i] = blocks_[2 * i];
      blocks_[i] += blocks_[2 * i + 1];
    }
    blocks_.resize(num_blocks_max / 2);
    block_size_ *= 2;
  }
  blocks_.push_back(group);
}

OneWayAnalysis GroupedValues::analysis(double confidence) const {
  if (!means_) return {.group_size = group_size_};
  const Moments means = means_->moments();
  const auto size = static_cast<double>(group_size_);
  OneWayAnalysis of{.num_groups = means.count, .group_size = group_size_, .mean = means.mean};
  of.mean_interval = mean_interval(means, confidence);
  of.within_mean_square = within_.value() / (static_cast<double>(means.count) * (size - 1.0));
  of.within_deviation = std::sqrt(of.within_mean_square);
  if (means.count < 2) return of;
  of.between_mean_square = size * means.standard_deviation * means.standard_deviation;
  const double between = std::fmax((*of.between_mean_square - of.within_mean_square) / size, 0.0);
  of.between_deviation = std::sqrt(between);
  const double variance = between + of.within_mean_square;
  if (variance > 0.0) of.within_share = of.within_mean_square / variance;
  of.within_share_interval = share_interval(confidence);
  return of;
}

/// ln F of some of the groups; not a number if all variance is within or between groups.
double GroupedValues::log_ratio(const Block& groups) const {
  const auto size = static_cast<double>(group_size_);
  const auto count = static_cast<double>(groups.num_groups);
  const double between = size * (groups.squares - groups.sum * groups.sum / count) / (count - 1.0);
  const double within = groups.within / (count * (size - 1.0));
  if (between <= 0.0 || within <= 0.0) return std::numeric_limits<double>::quiet_NaN();
  return logarithm(between) - logarithm(within);
}

std::optional<Interval> GroupedValues::share_interval(double confidence) const {
  Block all;
  for (const Block& block : blocks_) all += block;
  if (all.num_groups < num_groups_min) return std::nullopt;
  const double log_of_all = log_ratio(all);
  const auto count = static_cast<double>(blocks_.size());
  std::vector<double> pseudo_values;
  for (const Block& block : blocks_) {
    const Block others{all.num_groups - block.num_groups, all.sum - block.sum,
                       all.squares - block.squares, all.within - block.within};
    pseudo_values.push_back(count * log_of_all - (count - 1.0) * log_ratio(others));
    if (!std::isfinite(pseudo_values.back())) return std::nullopt;
  }
  const Moments about = moments(pseudo_values);
  // The degrees of freedom that a χ² law with the variance of the pseudo-values' variance has.
  const double degrees =
      std::clamp(2.0 * count / (2.0 + about.excess_kurtosis), degrees_min, count - 1.0);
  const double half_width = student_quantile(0.5 * (1.0 + confidence), degrees) *
                            about.standard_deviation / std::sqrt(count);
  // F estimates 1 + size σ_b²/σ_w², which is never below 1.
  const auto share = [&](double log_of_ratio) {
    return 1.0 / (1.0 + (exponential(std::clamp(log_of_ratio, 0.0, log_max)) - 1.0) /
                            static_cast<double>(group_size_));
  };
  return Interval{.lower = share(std::fmax(about.mean, 0.0) + half_width),
                  .upper = share(about.mean - half_width),
                  .confidence = confidence};
}

void GroupedHits::add(std::uint64_t num_hits) {
  PROOFMASS_EXPECT(num_hits <= group_size_);
  ++num_groups_;
  if (num_hits > 0) ++num_with_hit_;
  if (num_hits < group_size_) ++num_with_miss_;
  const auto hits = static_cast<double>(num_hits);
  hits_ += hits;
  squared_hits_ += hits * hits;
}

double GroupedHits::share() const {
  PROOFMASS_EXPECT(num_groups_ > 0);
  return hits_ / (static_cast<double>(num_groups_) * static_cast<double>(group_size_));
}

Interval GroupedHits::interval(double confidence) const {
  const double p = share();
  const auto groups = static_cast<double>(num_groups_);
  const double members = groups * static_cast<double>(group_size_);
  double effective = groups;
  if (std::min(num_with_hit_, num_with_miss_) >= num_telling_groups_min) {
    // Of the number of hits in a group; that of independent members is size p (1 − p).
    const double variance = (squared_hits_ - hits_ * hits_ / groups) / (groups - 1.0);
    const double probability = 0.5 * (1.0 + confidence);
    const double t_ratio =
        student_quantile(probability, members - 1.0) / student_quantile(probability, groups - 1.0);
    const double of_independent = static_cast<double>(group_size_) * p * (1.0 - p);
    if (variance > 0.0) {
      effective = members * std::fmin(1.0, of_independent / variance * t_ratio * t_ratio);
    }
  }
  Interval interval = probability_interval(p * effective, effective, confidence);
  // Less than one hit, or miss, excludes no probability, however small.
  if (p * effective < 1.0) interval.lower = 0.0;
  if ((1.0 - p) * effective < 1.0) interval.upper = 1.0;
  return interval;
}

}  // namespace proofmass
