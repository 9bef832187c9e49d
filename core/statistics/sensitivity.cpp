#include "core/statistics/sensitivity.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/math/elementary.hpp"
#include "core/statistics/comparison.hpp"
#include "core/statistics/correlation.hpp"
#include "core/statistics/detail/check.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"

namespace proofmass {
namespace {

/// Neighbours on either side whose mean stands for the conditional mean of an output.
constexpr std::size_t num_neighbours = 2;
/// Degrees of freedom that the variance of an index lacks; README.md has the coverage.
constexpr double num_lost_degrees = 6.0;

/// Bins of the test. Few are powerful for smooth dependences and miss oscillations inside a bin.
std::size_t num_bins_for(std::size_t num_values) {
  const auto root = static_cast<std::size_t>(std::sqrt(static_cast<double>(num_values)));
  return std::clamp(root / 2, std::size_t{4}, std::size_t{64});
}

/// Subtracts the mean; the second round takes what the first mean lacked for its rounding.
void centre(std::span<double> values) {
  for (int round = 0; round < 2; ++round) {
    const double mean = compensated_sum(values) / static_cast<double>(values.size());
    for (double& value : values) value -= mean;
  }
}

double sum_of_squares(std::span<const double> values) {
  CompensatedSum sum;
  for (const double value : values) sum.add(value * value);
  return sum.value();
}

/// Where parts of the order along an input end. Neighbours on both sides of a border are none.
using Borders = std::vector<std::size_t>;

// Half the squared differences of neighbours, added up. The first and the last one of a part count
// half as much again, as the values at the ends have one neighbour only.
double sum_of_differences(std::span<const double> values, const Borders& borders) {
  const auto half_square = [&](std::size_t i) {
    const double difference = values[i + 1] - values[i];
    return 0.5 * difference * difference;
  };
  CompensatedSum sum;
  std::size_t first = 0;
  for (const std::size_t end : borders) {
    for (std::size_t i = first; i + 1 < end; ++i) sum.add(half_square(i));
    if (end - first > 1) {
      sum.add(0.5 * half_square(first));
      sum.add(0.5 * half_square(end - 2));
    }
    first = end;
  }
  return sum.value();
}

/// A value minus the mean of its neighbours in [begin, end), two on either side where there are as
/// many; 0 without any.
double local_residual(std::span<const double> values, std::size_t i, std::size_t begin,
                      std::size_t end) {
  const std::size_t first = std::max(begin + num_neighbours, i) - num_neighbours;
  const std::size_t last = std::min(i + num_neighbours, end - 1);
  if (first == last) return 0.0;
  double sum = 0.0;
  for (std::size_t j = first; j <= last; ++j) {
    if (j != i) sum += values[j];
  }
  return values[i] - sum / static_cast<double>(last - first);
}

// The influence of one run on 1 − w/v, w being the variance that the input leaves and v that of
// all, is ψ = ((1 − index)(y − ȳ)² − (y − m(x))²)/v. Products of neighbours, whose sum is not an
// influence of single runs, add w²/v². The mean of four neighbours in place of m(x) has the
// variance w/4, which makes Σψ² larger by (2 ε m̂)² = 4·w²/4 a run: just these w²/v².
double standard_error_of(double index, double variance, std::span<const double> differences,
                         const Borders& borders) {
  const auto n = static_cast<double>(differences.size());
  std::vector<double> influences(differences.size());
  std::size_t begin = 0;
  for (const std::size_t end : borders) {
    for (std::size_t i = begin; i < end; ++i) {
      const double residual = local_residual(differences, i, begin, end);
      influences[i] =
          ((1.0 - index) * differences[i] * differences[i] - residual * residual) / variance;
    }
    begin = end;
  }
  centre(influences);
  return std::sqrt(sum_of_squares(influences) / (n * (n - num_lost_degrees)));
}

// Student's interval of the logarithm of 1 − index, which keeps it below 1.
Interval interval_of(double index, double standard_error, double num_values, double confidence) {
  const double rest = 1.0 - index;
  if (rest <= 0.0) return {index, index, confidence};
  const double quantile = student_quantile(0.5 + 0.5 * confidence, num_values - num_lost_degrees);
  const double factor = exponential(std::min(quantile * standard_error / rest, 700.0));
  return {1.0 - rest * factor, 1.0 - rest / factor, confidence};
}

/// Ranks of a column, and what their mean square lacks for equal values, as a factor.
struct Ranks {
  std::vector<double> values;
  double square_sum = 0.0;  ///< Σ(rank − mean)².
};

Ranks ranks_of(Column column) {
  Ranks ranks{.values = average_ranks(column)};
  const double mean = 0.5 * (static_cast<double>(column.size()) + 1.0);
  CompensatedSum sum;
  for (const double rank : ranks.values) sum.add((rank - mean) * (rank - mean));
  ranks.square_sum = sum.value();
  return ranks;
}

/// How the order along an input is cut.
struct Cuts {
  Borders bins;   ///< Of the test: of equal counts, but a value that fills one is one by itself.
  Borders parts;  ///< So many equal values or more are one, and so is what lies between.
};
constexpr std::size_t part_size_min = 5;

void sort_once(Borders& borders) {
  std::ranges::sort(borders);
  borders.erase(std::ranges::unique(borders).begin(), borders.end());
}

Cuts cuts_of(std::span<const std::size_t> order, Column input) {
  const std::size_t n = order.size(), num_bins = num_bins_for(n);
  Cuts cuts;
  for (std::size_t bin = 0; bin < num_bins; ++bin) {
    cuts.bins.push_back((bin + 1) * n / num_bins);
  }
  for (std::size_t first = 0, end = 0; first < n; first = end) {
    while (end < n && input[order[end]] == input[order[first]]) ++end;
    if (end - first >= part_size_min) cuts.parts.insert(cuts.parts.end(), {first, end});
    if (end - first < n / num_bins) continue;
    std::erase_if(cuts.bins, [&](std::size_t at) { return at > first && at < end; });
    cuts.bins.insert(cuts.bins.end(), {first, end});
  }
  std::erase(cuts.bins, 0);
  sort_once(cuts.bins);
  sort_once(cuts.parts);
  std::size_t begin = 0;
  std::erase_if(cuts.parts, [&](std::size_t at) {
    if (at - begin < part_size_min || n - at < part_size_min) return true;
    begin = at;
    return false;
  });
  cuts.parts.push_back(n);
  return cuts;
}

// H = (n − 1) Σ(squared mean rank deviation of a bin · its size)/Σ(rank − mean)², by the chi-square
// law.
double dependence_p_value(std::span<const std::size_t> order, const Borders& bins,
                          const Ranks& output) {
  const auto n = static_cast<double>(order.size());
  const double mean = 0.5 * (n + 1.0);
  CompensatedSum between;
  std::size_t first = 0;
  for (const std::size_t end : bins) {
    double sum = 0.0;  // Of halves: exact.
    for (std::size_t i = first; i < end; ++i) sum += output.values[order[i]] - mean;
    between.add(sum * sum / static_cast<double>(end - first));
    first = end;
  }
  const double statistic = (n - 1.0) * between.value() / output.square_sum;
  return chi_square_above(statistic, static_cast<double>(bins.size()) - 1.0);
}

/// @pre Both columns vary and have sensitivity_values_min values.
FirstOrderIndex index_of(std::span<const std::size_t> order, const Cuts& cuts, Column output,
                         const Ranks& ranks, double confidence) {
  const auto n = static_cast<double>(order.size());
  std::vector<double> differences(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) differences[i] = output[order[i]];
  centre(differences);
  const double variance = sum_of_squares(differences) / (n - 1.0);
  const double index = 1.0 - sum_of_differences(differences, cuts.parts) / n / variance;
  const double standard_error = standard_error_of(index, variance, differences, cuts.parts);
  return {.index = index,
          .standard_error = standard_error,
          .interval = interval_of(index, standard_error, n, confidence),
          .p_value = dependence_p_value(order, cuts.bins, ranks)};
}

/// Ranks of each output; none for one that does not vary.
std::vector<Ranks> ranks_of_all(std::span<const Column> outputs) {
  std::vector<Ranks> ranks(outputs.size());
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    detail::check_same_size("output", outputs[i], outputs.front());
    detail::check_values("output", outputs[i], sensitivity_values_min);
    if (detail::varies(outputs[i])) ranks[i] = ranks_of(outputs[i]);
  }
  return ranks;
}

void adjust(std::vector<Sensitivity>& of_output, std::size_t num_outputs) {
  std::vector<double> p_values;
  for (const Sensitivity& one : of_output) p_values.push_back(one.first_order.p_value);
  const std::vector<double> adjusted = holm_adjusted(p_values);
  for (std::size_t i = 0; i < of_output.size(); ++i) {
    of_output[i].adjusted_p_value = std::min(1.0, static_cast<double>(num_outputs) * adjusted[i]);
  }
}

void rank(std::vector<Sensitivity>& of_output, double significance) {
  const auto by_p_value = [](const Sensitivity& one) { return one.first_order.p_value; };
  const auto by_index = [](const Sensitivity& one) { return one.first_order.index; };
  const auto others = std::ranges::stable_partition(
      of_output, [&](const Sensitivity& one) { return one.adjusted_p_value < significance; });
  std::ranges::stable_sort(of_output.begin(), others.begin(), std::greater<>(), by_index);
  std::ranges::stable_sort(others, {}, by_p_value);
}

}  // namespace

std::vector<std::vector<Sensitivity>> sensitivities(std::span<const Column> inputs,
                                                    std::span<const Column> outputs,
                                                    double confidence, std::size_t num_outputs) {
  std::vector<std::vector<Sensitivity>> all(outputs.size());
  if (inputs.empty() || outputs.empty()) return all;
  const std::vector<Ranks> output_ranks = ranks_of_all(outputs);
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    detail::check_same_size("input", inputs[i], outputs.front());
    detail::check_values("input", inputs[i], sensitivity_values_min);
    if (!detail::varies(inputs[i])) continue;
    const std::vector<std::size_t> order = ascending_order(inputs[i]);
    const Cuts cuts = cuts_of(order, inputs[i]);
    const std::vector<double> ranks = average_ranks(inputs[i]);
    for (std::size_t j = 0; j < outputs.size(); ++j) {
      if (output_ranks[j].values.empty()) continue;
      const auto of_ranks = linear_correlation(ranks, output_ranks[j].values);
      if (!of_ranks) continue;
      all[j].push_back(
          {.input = i,
           .rank_correlation = *of_ranks,
           .first_order = index_of(order, cuts, outputs[j], output_ranks[j], confidence)});
    }
  }
  for (std::vector<Sensitivity>& of_output : all) {
    adjust(of_output, num_outputs);
    rank(of_output, 1.0 - confidence);
  }
  return all;
}

}  // namespace proofmass
