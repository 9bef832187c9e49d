#include "core/statistics/error_change.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "core/random/stream.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/interval.hpp"

namespace proofmass {
namespace {

constexpr double tail_factor = 2.0;

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

/// Mean sign s of x − mean. In a skew law it is not 0, and the mean of |x − mean| then changes by
/// −s times what the mean does.
double mean_sign(std::span<const double> errors) {
  const double mean = mean_of(errors, {});
  CompensatedSum signs;
  for (const double error : errors) {
    if (error != mean) signs.add(std::copysign(1.0, error - mean));
  }
  return signs.value() / static_cast<double>(errors.size());
}

/// |x − mean| − s (x − mean): the same mean as |x − mean| has, and the scatter that this mean has,
/// as the mean of a skew law moves it.
std::vector<double> scale_parts(std::span<const double> errors, double sign) {
  const double mean = mean_of(errors, {});
  std::vector<double> parts = distances(errors, mean);
  for (std::size_t i = 0; i < parts.size(); ++i) parts[i] -= sign * (errors[i] - mean);
  return parts;
}

Moments scale_moments(std::span<const double> errors) {
  return moments(scale_parts(errors, mean_sign(errors)));
}

/// The mean sign of both campaigns of pairs. Each with its own would differ by chance, in pairs
/// that agree by more than the pairs do.
double mean_sign_of_pairs(std::span<const double> first, std::span<const double> second) {
  return 0.5 * (mean_sign(first) + mean_sign(second));
}

/// What the second run of a pair adds to the scale of its campaign beyond what the first one adds.
/// What rounding makes of equal parts is 0: at most 12 ε times the largest number for the means,
/// the distances and their parts, and ε for each of two errors that were shifted.
std::vector<double> scale_differences(std::span<const double> first,
                                      std::span<const double> second) {
  const double sign = mean_sign_of_pairs(first, second);
  const std::vector<double> of_first = scale_parts(first, sign);
  std::vector<double> differences = scale_parts(second, sign);
  const double of_means = std::max(std::abs(mean_of(first, {})), std::abs(mean_of(second, {})));
  for (std::size_t i = 0; i < first.size(); ++i) {
    differences[i] -= of_first[i];
    const double largest = std::max({std::abs(first[i]), std::abs(second[i]), of_means});
    const bool is_rounding =
        std::abs(differences[i]) <= 16.0 * std::numeric_limits<double>::epsilon() * largest;
    if (is_rounding) differences[i] = 0.0;
  }
  return differences;
}

double pooled_p_value(const Moments& first, const Moments& second) {
  return student_p_value(second.mean - first.mean, pooled_error(first, second));
}

/// Is the mean of differences 0? Wilcoxon's test asks whether they are symmetric about it, too.
double paired_p_value(const std::vector<double>& differences) {
  const Moments about = moments(differences);
  const auto n = static_cast<double>(about.count);
  const bool is_small = differences.size() < num_welch_min;
  const double by_rank = is_small ? rank_test_p_value(differences) : 0.0;
  if (differences.size() < 2) return by_rank;
  return std::max(by_rank,
                  student_p_value(about.mean, {about.standard_deviation / std::sqrt(n), n - 1.0}));
}

}  // namespace

double tail_limit(std::span<const double> first, std::span<const double> second) {
  const auto square_sum = [](std::span<const double> errors) {
    CompensatedSum sum;
    for (const double error : errors) sum.add(error * error);
    return sum.value();
  };
  const auto count = static_cast<double>(first.size() + second.size());
  return tail_factor * std::sqrt((square_sum(first) + square_sum(second)) / count);
}

std::size_t num_beyond(std::span<const double> errors, double limit) {
  return static_cast<std::size_t>(
      std::ranges::count_if(errors, [&](double error) { return std::abs(error) > limit; }));
}

ChangePValues compare_errors(std::span<const double> first, std::span<const double> second) {
  const double limit = tail_limit(first, second);
  ChangePValues changes{.tail = fisher_exact_p_value({.num_first = first.size(),
                                                      .tail_first = num_beyond(first, limit),
                                                      .num_second = second.size(),
                                                      .tail_second = num_beyond(second, limit)})};
  if (std::min(first.size(), second.size()) < num_welch_min) {
    const double centre = mean_of(first, second);
    changes.location = compare_unpaired(first, second, default_confidence).p_value;
    changes.scale =
        compare_unpaired(distances(first, centre), distances(second, centre), default_confidence)
            .p_value;
  } else {
    changes.location = compare_means(moments(first), moments(second), default_confidence).p_value;
    changes.scale = pooled_p_value(scale_moments(first), scale_moments(second));
  }
  return changes;
}

ChangePValues compare_paired_errors(std::span<const double> first, std::span<const double> second) {
  const double limit = tail_limit(first, second);
  std::vector<double> differences(first.size());
  std::ranges::transform(second, first, differences.begin(), std::minus<>());
  std::size_t num_only_first = 0, num_only_second = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const bool is_first_beyond = std::abs(first[i]) > limit;
    const bool is_second_beyond = std::abs(second[i]) > limit;
    if (is_first_beyond && !is_second_beyond) ++num_only_first;
    if (is_second_beyond && !is_first_beyond) ++num_only_second;
  }
  return {.location = paired_p_value(differences),
          .scale = paired_p_value(scale_differences(first, second)),
          .tail = sign_test_p_value(num_only_first, num_only_second)};
}

namespace {

/// The normal deviate that a test statistic must exceed to be found.
double found_deviate(std::size_t num_parameters) {
  const double level =
      (1.0 - default_confidence) * scale_weight / static_cast<double>(num_parameters);
  return inverse_normal(1.0 - 0.5 * level);
}

/// The factor f = next(f); empty if there is none or only a very large one.
/// @param slope  next() rises by this for each 1 at the most.
template <typename Next>
std::optional<double> fixed_point(double slope, const Next& next) {
  if (!(slope < 0.99)) return std::nullopt;
  double factor = 1.0;
  for (int i = 0; i < 2000; ++i) factor = next(factor);  // Each time nearer by `slope` at least.
  return factor;
}

/// scale_parts() in units of their own mean; none if there is no scatter.
std::vector<double> relative_scale_parts(std::span<const double> errors, double sign) {
  std::vector<double> relative = scale_parts(errors, sign);
  const double mean = moments(relative).mean;
  if (!(mean > 0.0)) return {};
  for (double& part : relative) part /= mean;
  return relative;
}

constexpr double rounding_max = 1e-9;  // Of a change of the scatter.

}  // namespace

// f − 1 = z √(c²/n + f² c²/m) + z' √(c²/m + f² c²/n) with the relative deviation c of the distances
// from the mean, z and z' of level and probability: the first root is the pooled error.
std::optional<double> smallest_scale_factor(std::span<const double> first,
                                            std::span<const double> second,
                                            std::size_t num_parameters) {
  if (std::min(first.size(), second.size()) < num_welch_min) return std::nullopt;
  const Moments a = scale_moments(first), b = scale_moments(second);
  const auto m = static_cast<double>(a.count), n = static_cast<double>(b.count);
  const double of_a = a.standard_deviation / a.mean, of_b = b.standard_deviation / b.mean;
  const double c = std::sqrt(((m - 1.0) * of_a * of_a + (n - 1.0) * of_b * of_b) / (m + n - 2.0));
  const double z = found_deviate(num_parameters), z_found = inverse_normal(finding_probability);
  return fixed_point(c * (z / std::sqrt(m) + z_found / std::sqrt(n)), [&](double factor) {
    const double square = factor * factor;
    return 1.0 +
           c * (z * std::sqrt(1.0 / n + square / m) + z_found * std::sqrt(1.0 / m + square / n));
  });
}

// f − 1 = (z + z') s(f)/(μ √n), with s(f) the deviation of f b − a, a and b being the parts of the
// scale of a pair, b brought to the mean μ of a: what has changed is not of the scatter of pairs.
// Of few pairs both tests must find it; Wilcoxon's needs no more than 1/0.864 times the pairs of
// Student's t, whatever the law.
std::optional<double> smallest_paired_scale_factor(std::span<const double> first,
                                                   std::span<const double> second,
                                                   std::size_t num_parameters) {
  constexpr std::size_t num_pairs_min = 10;
  if (first.size() < num_pairs_min) return std::nullopt;
  const double efficiency = first.size() < num_welch_min ? 0.864 : 1.0;
  const auto n = static_cast<double>(first.size());
  const double sign = mean_sign_of_pairs(first, second);
  const std::vector<double> a = relative_scale_parts(first, sign);
  const std::vector<double> b = relative_scale_parts(second, sign);
  if (a.empty() || b.empty()) return std::nullopt;
  const double scatter = moments(b).standard_deviation, of_a = moments(a).standard_deviation;
  std::vector<double> differences(a.size());
  std::ranges::transform(b, a, differences.begin(), std::minus<>());
  const double apart = moments(differences).standard_deviation;
  if (apart < rounding_max) return std::nullopt;  // Any factor is found in pairs that are equal.
  const double covariance_of_b = 0.5 * (apart * apart + scatter * scatter - of_a * of_a);
  const double z = (found_deviate(num_parameters) + inverse_normal(finding_probability)) /
                   std::sqrt(efficiency * n);
  return fixed_point(z * scatter, [&](double factor) {  // f b − a = (b − a) + (f − 1) b.
    const double more = factor - 1.0;
    return 1.0 + z * std::sqrt(apart * apart + more * more * scatter * scatter +
                               2.0 * more * covariance_of_b);
  });
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
