#include "core/statistics/independence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "core/statistics/detail/check.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/order.hpp"

namespace proofmass {
namespace {

constexpr std::size_t num_values_min = 20;
constexpr std::size_t num_lags = 5;
/// Values of so many on average at one level are levels, and not rounded numbers.
constexpr std::size_t num_at_level_min = 5;

/// The sum of products of the centred ranks of two rows is nearly normal for independent values, of
/// the variance n σ⁴. Of values that are rare, products of two hardly occur; where one does, the
/// sum of squares of what occurred is larger.
double serial_p_value(std::span<const double> values) {
  std::vector<double> ranks = average_ranks(values);
  const auto n = static_cast<double>(ranks.size());
  double rank_squares = 0.0;
  for (double& rank : ranks) {
    rank -= 0.5 * (n + 1.0);
    rank_squares += rank * rank;
  }
  if (rank_squares <= 0.0) return 1.0;
  double least = 1.0;
  for (std::size_t lag = 1; lag <= num_lags; ++lag) {
    double sum = 0.0, squares = 0.0;
    for (std::size_t i = lag; i < ranks.size(); ++i) {
      const double product = ranks[i] * ranks[i - lag];
      sum += product;
      squares += product * product;
    }
    const double deviation = std::max(rank_squares / std::sqrt(n), std::sqrt(squares));
    least = std::min(least, 2.0 * normal_cumulative(-std::abs(sum) / deviation));
  }
  return std::min(1.0, least * static_cast<double>(num_lags));
}

/// Of levels that each have as many values as the others: Pearson's χ², which is too small there.
/// Counts are whole: each may be half a value further from what is expected.
double level_p_value(std::span<const double> ascending, std::size_t num_levels) {
  const auto expected = static_cast<double>(ascending.size()) / static_cast<double>(num_levels);
  double chi_square = 0.0;
  for (auto begin = ascending.begin(); begin != ascending.end();) {
    const auto end = std::upper_bound(begin, ascending.end(), *begin);
    const double excess = std::abs(static_cast<double>(end - begin) - expected) + 0.5;
    chi_square += excess * excess / expected;
    begin = end;
  }
  const double freedom = static_cast<double>(num_levels) - 1.0;
  return chi_square_at_most(chi_square, freedom);
}

/// Two neighbouring gaps a and b of ordered independent values are exponential with nearly the
/// same mean, so that |a − b|/(a + b) is uniform, whatever the law.
double gap_p_value(std::span<const double> ascending) {
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t i = 2; i < ascending.size(); i += 2) {
    const double first = ascending[i - 1] - ascending[i - 2];
    const double second = ascending[i] - ascending[i - 1];
    sum += first + second > 0.0 ? std::abs(first - second) / (first + second) : 1.0;
    count += 1.0;
  }
  return normal_cumulative((sum / count - 0.5) * std::sqrt(12.0 * count));
}

double regular_p_value(std::span<const double> values) {
  const std::vector<double> ascending = sorted(values);
  std::vector<double> levels = ascending;
  levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
  if (levels.size() * num_at_level_min > values.size()) return gap_p_value(ascending);
  return levels.size() < 2 ? 1.0 : level_p_value(ascending, levels.size());
}

}  // namespace

IndependencePValues independence_p_values(std::span<const double> values) {
  detail::check_values("values", values, 0);
  if (values.size() < num_values_min) return {};
  return {.serial = serial_p_value(values), .regular = regular_p_value(values)};
}

std::string why_dependent(std::span<const double> values) {
  const IndependencePValues p_values = independence_p_values(values);
  if (p_values.serial < independence_p_value_min) {
    return fmt::format("depends on the order of its rows, p = {:.1g}", p_values.serial);
  }
  if (p_values.regular >= independence_p_value_min) return "";
  return fmt::format("covers its range more evenly than independent draws do, p = {:.1g}",
                     p_values.regular);
}

}  // namespace proofmass
