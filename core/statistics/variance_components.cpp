#include "core/statistics/variance_components.hpp"

#include <algorithm>
#include <cmath>

#include "core/error.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass {
namespace {

double f_quantile(double probability, double degrees_1, double degrees_2) {
  const double x = beta_quantile(probability, 0.5 * degrees_1, 0.5 * degrees_2);
  return degrees_2 * x / (degrees_1 * (1.0 - x));
}

double root_of_positive(double square) { return std::sqrt(std::fmax(square, 0.0)); }

/// Intervals of an analysis that has its mean squares, both of them positive.
void add_intervals(OneWayAnalysis& of, double confidence) {
  const auto size = static_cast<double>(of.group_size);
  const double between = static_cast<double>(of.num_groups) - 1.0;
  const double within = static_cast<double>(of.num_groups) * (size - 1.0);
  const double low = 0.5 * (1.0 - confidence), high = 1.0 - low;
  const double f = of.between_mean_square / of.within_mean_square;
  const double f_low = f_quantile(low, between, within);
  const double f_high = f_quantile(high, between, within);
  of.within_interval = {
      .lower = std::sqrt(within * of.within_mean_square / chi_square_quantile(high, within)),
      .upper = std::sqrt(within * of.within_mean_square / chi_square_quantile(low, within)),
      .confidence = confidence};
  // F is (1 + size σ_b²/σ_w²) times a value of its law.
  const auto share = [&](double quantile) {
    return 1.0 / (1.0 + std::fmax(f / quantile - 1.0, 0.0) / size);
  };
  of.within_share_interval = {
      .lower = share(f_low), .upper = share(f_high), .confidence = confidence};
  const double sum = between * of.between_mean_square;
  of.between_interval = {
      .lower =
          root_of_positive(sum * (1.0 - f_high / f) / (size * chi_square_quantile(high, between))),
      .upper =
          root_of_positive(sum * (1.0 - f_low / f) / (size * chi_square_quantile(low, between))),
      .confidence = confidence};
}

}  // namespace

void GroupedValues::add(std::span<const double> group) {
  PROOFMASS_EXPECT(group.size() == group_size_ && group_size_ > 1);
  const double mean = compensated_sum(group) / static_cast<double>(group_size_);
  if (!means_) means_.emplace(mean);
  means_->add(mean);
  for (const double value : group) within_.add((value - mean) * (value - mean));
}

OneWayAnalysis GroupedValues::analysis(double confidence) const {
  PROOFMASS_EXPECT(means_.has_value());
  const Moments means = means_->moments();
  const auto size = static_cast<double>(group_size_);
  const auto groups = static_cast<double>(means.count);
  OneWayAnalysis of{.num_groups = means.count, .group_size = group_size_, .mean = means.mean};
  of.mean_interval = mean_interval(means, confidence);
  of.within_mean_square = within_.value() / (groups * (size - 1.0));
  of.within_deviation = std::sqrt(of.within_mean_square);
  of.within_share = of.within_mean_square > 0.0 ? 1.0 : 0.0;
  if (means.count < 2) return of;
  of.between_mean_square = size * means.standard_deviation * means.standard_deviation;
  const double variance = std::fmax((of.between_mean_square - of.within_mean_square) / size, 0.0);
  of.between_deviation = std::sqrt(variance);
  if (of.within_mean_square > 0.0) {
    of.within_share = of.within_mean_square / (variance + of.within_mean_square);
  }
  if (of.within_mean_square <= 0.0 || of.between_mean_square <= 0.0) return of;
  const double a = 0.5 * (groups - 1.0), b = 0.5 * groups * (size - 1.0);
  const double odds = a * of.between_mean_square / (b * of.within_mean_square);
  of.p_value = beta_above(odds / (1.0 + odds), a, b);
  add_intervals(of, confidence);
  return of;
}

Interval grouped_probability_interval(const Moments& shares, std::size_t group_size,
                                      double confidence) {
  const auto groups = static_cast<double>(shares.count);
  const double members = groups * static_cast<double>(group_size);
  const double p = shares.mean;
  const double of_independent = p * (1.0 - p) / members;
  const double found = shares.standard_deviation * shares.standard_deviation / groups;
  double effective = members;
  if (p <= 0.0 || p >= 1.0) {
    effective = groups;
  } else if (shares.count > 1 && found > 0.0) {
    const double probability = 0.5 * (1.0 + confidence);
    const double t_ratio =
        student_quantile(probability, members - 1.0) / student_quantile(probability, groups - 1.0);
    effective = std::fmin(members, members * of_independent / found * t_ratio * t_ratio);
  }
  return probability_interval(std::clamp(p, 0.0, 1.0) * effective, effective, confidence);
}

}  // namespace proofmass
