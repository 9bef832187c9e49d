#include "core/statistics/comparison.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/statistics/detail/check.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/order.hpp"

namespace proofmass {
namespace {

constexpr std::size_t num_exact_ranks_max = 50;  // 2⁵⁰ signs are counted exactly in a double.
constexpr std::uint64_t num_exact_steps_max = 4'000'000;

/// Fraction of all choices of signs whose sum of positive ranks is at most `sum`.
double exact_rank_probability(std::size_t count, double sum) {
  std::vector<double> num_choices(count * (count + 1) / 2 + 1, 0.0);
  num_choices[0] = 1.0;
  for (std::size_t rank = 1; rank <= count; ++rank) {
    for (std::size_t total = num_choices.size() - 1; total >= rank; --total) {
      num_choices[total] += num_choices[total - rank];
    }
  }
  double num_below = 0.0;
  for (std::size_t total = 0; static_cast<double>(total) <= sum; ++total) {
    num_below += num_choices[total];
  }
  return std::ldexp(num_below, -static_cast<int>(count));
}

/// Largest |i/m − j/n| of the distribution functions, times m n: an exact integer.
std::uint64_t scaled_distance(std::span<const double> first, std::span<const double> second) {
  const auto m = static_cast<std::int64_t>(first.size());
  const auto n = static_cast<std::int64_t>(second.size());
  std::int64_t i = 0;
  std::int64_t j = 0;
  std::int64_t largest = 0;
  while (i < m && j < n) {
    const double next =
        std::min(first[static_cast<std::size_t>(i)], second[static_cast<std::size_t>(j)]);
    while (i < m && first[static_cast<std::size_t>(i)] == next) ++i;
    while (j < n && second[static_cast<std::size_t>(j)] == next) ++j;
    largest = std::max(largest, std::abs(i * n - j * m));
  }
  return static_cast<std::uint64_t>(largest);
}

// Probability that a random path of m steps right and n steps up comes so far from the diagonal.
// The last step to (i, j) was to the right with probability i/(i + j); once out, a path stays
// counted.
double exact_law_p_value(std::uint64_t m, std::uint64_t n, std::uint64_t distance) {
  std::vector<double> is_out(n + 1, 0.0);  // For the current i, at each j.
  for (std::uint64_t i = 0; i <= m; ++i) {
    for (std::uint64_t j = 0; j <= n; ++j) {
      const std::uint64_t apart = i * n > j * m ? i * n - j * m : j * m - i * n;
      if (apart >= distance) {
        is_out[j] = 1.0;
        continue;
      }
      const auto steps = static_cast<double>(i + j);
      double probability = 0.0;
      if (i > 0) probability += static_cast<double>(i) / steps * is_out[j];
      if (j > 0) probability += static_cast<double>(j) / steps * is_out[j - 1];
      is_out[j] = probability;
    }
  }
  return is_out[n];
}

double law_p_value(std::uint64_t m, std::uint64_t n, std::uint64_t distance) {
  if (distance == 0) return 1.0;
  if (m * n <= num_exact_steps_max) return exact_law_p_value(m, n, distance);
  const double product = static_cast<double>(m) * static_cast<double>(n);
  const double root = std::sqrt(product / static_cast<double>(m + n));
  return kolmogorov_upper(root * static_cast<double>(distance) / product);
}

/// With the degrees of freedom of Satterthwaite.
StandardError welch_error(const Moments& first, const Moments& second) {
  const auto squared_error = [](const Moments& one) {
    return one.standard_deviation * one.standard_deviation / static_cast<double>(one.count);
  };
  const double a = squared_error(first), b = squared_error(second);
  if (a + b <= 0.0) return {};
  // From the shares of the squared error: the square of a large one leaves the range of a double.
  const double share_a = a / (a + b), share_b = b / (a + b);
  return {std::sqrt(a + b), 1.0 / (share_a * share_a / (static_cast<double>(first.count) - 1.0) +
                                   share_b * share_b / (static_cast<double>(second.count) - 1.0))};
}

}  // namespace

double student_p_value(double mean, const StandardError& error) {
  if (error.value <= 0.0) return mean == 0.0 ? 1.0 : 0.0;
  return student_two_sided(mean / error.value, error.degrees);
}

StandardError pooled_error(const Moments& first, const Moments& second) {
  const auto m = static_cast<double>(first.count), n = static_cast<double>(second.count);
  const double variance = ((m - 1.0) * first.standard_deviation * first.standard_deviation +
                           (n - 1.0) * second.standard_deviation * second.standard_deviation) /
                          (m + n - 2.0);
  return {std::sqrt(variance * (1.0 / m + 1.0 / n)), m + n - 2.0};
}

UnpairedComparison compare_means(const Moments& first, const Moments& second, double confidence) {
  detail::check_fraction("confidence", confidence);
  UnpairedComparison comparison;
  comparison.mean_difference = second.mean - first.mean;
  comparison.mean_p_value = 0.0;
  double half_width = 0.0;
  for (const StandardError& of : {welch_error(first, second), pooled_error(first, second)}) {
    comparison.mean_p_value =
        std::max(comparison.mean_p_value, student_p_value(comparison.mean_difference, of));
    if (of.value <= 0.0) continue;
    half_width =
        std::max(half_width, student_quantile(0.5 + 0.5 * confidence, of.degrees) * of.value);
  }
  comparison.p_value = comparison.mean_p_value;
  if (half_width > 0.0) {
    comparison.interval = Interval{comparison.mean_difference - half_width,
                                   comparison.mean_difference + half_width, confidence};
  }
  return comparison;
}

double rank_test_p_value(std::vector<double> differences) {
  detail::check_values("differences", differences, 1);
  std::erase(differences, 0.0);
  if (differences.empty()) return 1.0;
  std::vector<double> magnitudes;
  for (const double difference : differences) magnitudes.push_back(std::abs(difference));
  const std::vector<double> ranks = average_ranks(magnitudes);
  double positive_sum = 0.0;  // Of halves: exact.
  CompensatedSum square_sum;
  for (std::size_t i = 0; i < ranks.size(); ++i) {
    if (differences[i] > 0.0) positive_sum += ranks[i];
    square_sum.add(ranks[i] * ranks[i]);
  }
  const auto n = static_cast<double>(ranks.size());
  const double all = 0.5 * n * (n + 1.0);
  const double smaller = std::min(positive_sum, all - positive_sum);
  // Ranks that are shared have smaller squares than 1² + 2² + ... + n².
  const bool has_equal = square_sum.value() < all * (2.0 * n + 1.0) / 3.0;
  if (ranks.size() <= num_exact_ranks_max && !has_equal) {
    return std::min(2.0 * exact_rank_probability(ranks.size(), smaller), 1.0);
  }
  // Each rank counts with probability ½: variance Σ rank²/4, equal ones included.
  const double deviation = std::sqrt(0.25 * square_sum.value());
  return std::min(2.0 * normal_cumulative((smaller - 0.5 * all) / deviation), 1.0);
}

UnpairedComparison compare_unpaired(std::span<const double> first, std::span<const double> second,
                                    double confidence) {
  detail::check_fraction("confidence", confidence);
  detail::check_values("first", first, 2);
  detail::check_values("second", second, 2);
  UnpairedComparison comparison = compare_means(moments(first), moments(second), confidence);
  const std::uint64_t distance = scaled_distance(sorted(first), sorted(second));
  comparison.distance = static_cast<double>(distance) / static_cast<double>(first.size()) /
                        static_cast<double>(second.size());
  comparison.law_p_value = law_p_value(first.size(), second.size(), distance);
  if (std::min(first.size(), second.size()) < num_welch_min) {
    comparison.p_value = std::max(comparison.mean_p_value, comparison.law_p_value);
  }
  return comparison;
}

double sign_test_p_value(std::size_t num_larger, std::size_t num_smaller) {
  const auto fewer = static_cast<double>(std::min(num_larger, num_smaller));
  const auto count = static_cast<double>(num_larger + num_smaller);
  if (count == 0.0) return 1.0;
  return std::min(2.0 * binomial_at_most(fewer, count, 0.5), 1.0);
}

// Holm's method with weights: the smallest p/w is held against the sum of all weights, the next one
// against the sum of the rest.
std::vector<double> holm_adjusted(std::span<const double> p_values,
                                  std::span<const double> weights) {
  if (!weights.empty()) detail::check_same_size("weights", weights, p_values);
  const auto weight = [&](std::size_t i) { return weights.empty() ? 1.0 : weights[i]; };
  std::vector<double> weighted(p_values.size());
  for (std::size_t i = 0; i < p_values.size(); ++i) weighted[i] = p_values[i] / weight(i);
  const std::vector<std::size_t> order = ascending_order(weighted);
  std::vector<double> adjusted(p_values.size());
  double rest = 0.0;
  for (const std::size_t i : order) rest += weight(i);
  double largest = 0.0;
  for (const std::size_t i : order) {
    largest = std::max(largest, std::min(rest * weighted[i], 1.0));
    adjusted[i] = largest;
    rest -= weight(i);
  }
  return adjusted;
}

}  // namespace proofmass
