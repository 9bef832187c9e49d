#include "core/statistics/error_change.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/random/normal.hpp"
#include "core/statistics/interval.hpp"

namespace proofmass {
namespace {

constexpr double tail_factor = 2.0;
/// Mean of |x| in standard deviations, for a normal x.
constexpr double normal_deviation = 0.8;

constexpr double location_weight = 0.5;
constexpr double scale_weight = 0.4;
constexpr double tail_weight = 0.1;

double mean_of(std::span<const double> first, std::span<const double> second) {
  CompensatedSum sum;
  for (const double value : first) sum.add(value);
  for (const double value : second) sum.add(value);
  return sum.value() / static_cast<double>(first.size() + second.size());
}

std::vector<double> distances(std::span<const double> values, double centre) {
  std::vector<double> distances(values.size());
  std::ranges::transform(values, distances.begin(),
                         [&](double value) { return std::abs(value - centre); });
  return distances;
}

ErrorPasses first_pass_of(std::span<const double> values) {
  ErrorPasses passes;
  for (const double value : values) passes.add(value);
  return passes;
}

std::size_t num_beyond(std::span<const double> values, double limit) {
  return static_cast<std::size_t>(
      std::ranges::count_if(values, [&](double value) { return std::abs(value) > limit; }));
}

}  // namespace

void ErrorPasses::add(double error) {
  ++count_;
  sum_.add(error);
  square_sum_.add(error * error);
}

double ErrorPasses::mean() const { return sum_.value() / static_cast<double>(count_); }

void ErrorPasses::begin_second(double limit) {
  mean_ = mean();
  limit_ = limit;
  const double mean_square = square_sum_.value() / static_cast<double>(count_);
  const double variance = std::max(mean_square - mean_ * mean_, 0.0);
  errors_ = MomentSums(mean_);
  deviations_ = MomentSums(normal_deviation * std::sqrt(variance));
}

void ErrorPasses::add_again(double error) {
  errors_.add(error);
  const double deviation = error - mean_;
  deviations_.add(std::abs(deviation));
  if (deviation != 0.0) sign_sum_.add(std::copysign(1.0, deviation));
  signed_square_sum_.add(deviation * std::abs(deviation));
  if (std::abs(error) > limit_) ++num_in_tail_;
}

Moments ErrorPasses::scale_moments() const {
  Moments scale = deviations();
  if (scale.count < 2) return scale;
  const auto n = static_cast<double>(scale.count);
  const double sign = sign_sum_.value() / n;
  const double covariance = signed_square_sum_.value() / (n - 1.0);
  const double deviation = errors().standard_deviation;
  const double variance = scale.standard_deviation * scale.standard_deviation +
                          sign * (sign * deviation * deviation - 2.0 * covariance);
  scale.standard_deviation = std::sqrt(std::max(variance, 0.0));
  return scale;
}

double tail_limit(const ErrorPasses& first, const ErrorPasses& second) {
  const double squares = first.square_sum() + second.square_sum();
  return tail_factor * std::sqrt(squares / static_cast<double>(first.count() + second.count()));
}

ChangePValues compare_many_errors(const ErrorPasses& first, const ErrorPasses& second) {
  return {
      .location = compare_means(first.errors(), second.errors(), default_confidence).mean_p_value,
      .scale = compare_means(first.scale_moments(), second.scale_moments(), default_confidence)
                   .mean_p_value,
      .tail = fisher_exact_p_value({.num_first = first.count(),
                                    .tail_first = first.num_in_tail(),
                                    .num_second = second.count(),
                                    .tail_second = second.num_in_tail()})};
}

ChangePValues compare_few_errors(std::span<const double> first, std::span<const double> second) {
  const double centre = mean_of(first, second);
  const double limit = tail_limit(first_pass_of(first), first_pass_of(second));
  return {.location = compare_unpaired(first, second, default_confidence).p_value,
          .scale = compare_unpaired(distances(first, centre), distances(second, centre),
                                    default_confidence)
                       .p_value,
          .tail = fisher_exact_p_value({.num_first = first.size(),
                                        .tail_first = num_beyond(first, limit),
                                        .num_second = second.size(),
                                        .tail_second = num_beyond(second, limit)})};
}

void PairedErrors::add(const CentredError& first, const CentredError& second, double limit) {
  differences.push_back(second.error - first.error);
  deviation_differences.push_back(std::abs(second.error - second.mean) -
                                  std::abs(first.error - first.mean));
  const bool is_first_beyond = std::abs(first.error) > limit;
  const bool is_second_beyond = std::abs(second.error) > limit;
  if (is_first_beyond && !is_second_beyond) ++num_only_first;
  if (is_second_beyond && !is_first_beyond) ++num_only_second;
}

ChangePValues compare_paired_errors(PairedErrors pairs) {
  return {.location = rank_test_p_value(std::move(pairs.differences)),
          .scale = rank_test_p_value(std::move(pairs.deviation_differences)),
          .tail = sign_test_p_value(pairs.num_only_first, pairs.num_only_second)};
}

namespace {

/// The normal deviate that a test statistic must have in the mean to be found.
double found_deviate(std::size_t num_parameters) {
  const double level =
      (1.0 - default_confidence) * scale_weight / static_cast<double>(num_parameters);
  return inverse_normal(1.0 - 0.5 * level) + inverse_normal(finding_probability);
}

}  // namespace

// (f − 1)² = z²(c₁²/m + f² c₂²/n) with the relative deviations c of the distances from the mean.
std::optional<double> smallest_scale_factor(const ErrorPasses& first, const ErrorPasses& second,
                                            std::size_t num_parameters) {
  const auto share = [&](const Moments& scale) {
    const double relative = found_deviate(num_parameters) * scale.standard_deviation / scale.mean;
    return relative * relative / static_cast<double>(scale.count);
  };
  const double a = share(first.scale_moments());
  const double b = share(second.scale_moments());
  if (!(a < 1.0 && b < 1.0)) return std::nullopt;
  return (1.0 + std::sqrt(1.0 - (1.0 - a) * (1.0 - b))) / (1.0 - b);
}

// A signed-rank test needs no more than 1/0.864 times the pairs of Student's t, whatever the law.
std::optional<double> smallest_scale_factor(const ErrorPasses& first, const PairedErrors& pairs,
                                            std::size_t num_parameters) {
  constexpr double least_efficiency = 0.864;
  const auto n = static_cast<double>(pairs.deviation_differences.size());
  const double deviation = moments(pairs.deviation_differences).standard_deviation;
  const double change = found_deviate(num_parameters) * deviation / std::sqrt(least_efficiency * n);
  const double mean = first.deviations().mean;
  if (!(mean > 0.0)) return std::nullopt;
  return 1.0 + change / mean;
}

std::vector<ChangePValues> adjusted_changes(std::span<const ChangePValues> changes) {
  std::vector<double> p_values, weights;
  for (const ChangePValues& change : changes) {
    p_values.insert(p_values.end(), {change.location, change.scale, change.tail});
    weights.insert(weights.end(), {location_weight, scale_weight, tail_weight});
  }
  const std::vector<double> adjusted = holm_adjusted(p_values, weights);
  std::vector<ChangePValues> all;
  for (std::size_t i = 0; i < adjusted.size(); i += 3) {
    all.push_back({adjusted[i], adjusted[i + 1], adjusted[i + 2]});
  }
  return all;
}

// Probabilities of the hypergeometric law follow from each other outwards from the mode: P(k + 1) =
// P(k) (K − k)(m − k)/((k + 1)(n − K + k + 1)), K in the tail of m + n.
double fisher_exact_p_value(const TailCounts& counts) {
  const auto m = static_cast<double>(counts.num_first);
  const auto n = static_cast<double>(counts.num_second);
  const auto all = static_cast<double>(counts.tail_first + counts.tail_second);
  const auto seen = static_cast<double>(counts.tail_first);
  const double smallest = std::max(0.0, all - n);
  const double largest = std::min(all, m);
  const double mode =
      std::clamp(std::floor((all + 1.0) * (m + 1.0) / (m + n + 2.0)), smallest, largest);
  const auto up = [&](double k) { return (all - k) * (m - k) / ((k + 1.0) * (n - all + k + 1.0)); };
  // The first sweep finds the probability of what is seen, the second adds up those below it.
  double of_seen = 1.0;
  for (double k = mode; k < seen; k += 1.0) of_seen *= up(k);
  for (double k = mode; k > seen; k -= 1.0) of_seen /= up(k - 1.0);
  const double bound = of_seen * (1.0 + 1e-7);  // As others have it: ties by rounding are ties.
  CompensatedSum total, below;
  const auto count = [&](double probability) {
    total.add(probability);
    if (probability <= bound) below.add(probability);
  };
  count(1.0);
  double probability = 1.0;
  for (double k = mode; k < largest && probability > 0.0; k += 1.0) {
    probability *= up(k);
    count(probability);
  }
  probability = 1.0;
  for (double k = mode; k > smallest && probability > 0.0; k -= 1.0) {
    probability /= up(k - 1.0);
    count(probability);
  }
  return std::min(below.value() / total.value(), 1.0);
}

}  // namespace proofmass
