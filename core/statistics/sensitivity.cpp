#include "core/statistics/sensitivity.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/statistics/detail/check.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/order.hpp"
#include "core/statistics/sum.hpp"

namespace proofmass {
namespace {

constexpr double noise_probability = 0.05;

std::size_t num_bins_for(std::size_t num_values) {
  const auto root = static_cast<std::size_t>(std::sqrt(static_cast<double>(num_values)));
  return std::clamp(root / 2, std::size_t{4}, std::size_t{64});
}

bool varies(Column column) {
  return std::ranges::any_of(column, [&](double value) { return value != column.front(); });
}

/// Subtracts the mean; the second round takes what the first mean lacked for its rounding.
void centre(std::span<double> values) {
  for (int round = 0; round < 2; ++round) {
    const double mean = compensated_sum(values) / static_cast<double>(values.size());
    for (double& value : values) value -= mean;
  }
}

/// Values minus the mean of their bin.
std::vector<double> residuals_in_bins(std::span<const double> values, std::size_t num_bins) {
  std::vector<double> residuals(values.begin(), values.end());
  for (std::size_t bin = 0; bin < num_bins; ++bin) {
    const std::size_t first = bin * values.size() / num_bins;
    const std::size_t end = (bin + 1) * values.size() / num_bins;
    centre(std::span(residuals).subspan(first, end - first));
  }
  return residuals;
}

double sum_of_squares(std::span<const double> values) {
  CompensatedSum sum;
  for (const double value : values) sum.add(value * value);
  return sum.value();
}

// The influence of one run on 1 − w/v, w and v being the mean squares within bins and of all, is
// ((1 − index)(y − ȳ)² − residual²)/v: the bins' means have none, to first order. To its variance
// comes that of the index of an unrelated input, 2(bins − 1)/n², which the first order lacks.
double standard_error_of(double index, double variance, std::span<const double> residuals,
                         std::span<const double> differences, std::size_t num_bins) {
  const auto n = static_cast<double>(residuals.size());
  CompensatedSum squares;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const double influence =
        ((1.0 - index) * differences[i] * differences[i] - residuals[i] * residuals[i]) / variance;
    squares.add(influence * influence);
  }
  const double unrelated =
      2.0 * (static_cast<double>(num_bins) - 1.0) * (1.0 - index) * (1.0 - index) / (n * n);
  return std::sqrt(squares.value() / (n * n) + unrelated);
}

double noise_level_of(double n, double bins) {
  const double ratio = fisher_quantile(1.0 - noise_probability, bins - 1.0, n - bins);
  return 1.0 - (n - 1.0) / (n - bins + (bins - 1.0) * ratio);
}

/// @pre Both columns vary and have sensitivity_values_min values.
FirstOrderIndex index_of(std::span<const std::size_t> order, Column output, double noise_level) {
  const auto n = static_cast<double>(order.size());
  const std::size_t num_bins = num_bins_for(order.size());
  std::vector<double> differences(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) differences[i] = output[order[i]];
  centre(differences);
  const std::vector<double> residuals = residuals_in_bins(differences, num_bins);
  const double within = sum_of_squares(residuals) / (n - static_cast<double>(num_bins));
  const double variance = sum_of_squares(differences) / (n - 1.0);
  const double index = 1.0 - within / variance;
  return {.index = index,
          .standard_error = standard_error_of(index, variance, residuals, differences, num_bins),
          .noise_level = noise_level,
          .num_bins = num_bins};
}

double noise_level_for(std::size_t num_values) {
  return noise_level_of(static_cast<double>(num_values),
                        static_cast<double>(num_bins_for(num_values)));
}

/// Ranks of each output; none for one that does not vary.
std::vector<std::vector<double>> ranks_of(std::span<const Column> outputs) {
  std::vector<std::vector<double>> ranks(outputs.size());
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    detail::check_same_size("output", outputs[i], outputs.front());
    detail::check_values("output", outputs[i], sensitivity_values_min);
    if (varies(outputs[i])) ranks[i] = average_ranks(outputs[i]);
  }
  return ranks;
}

}  // namespace

std::optional<FirstOrderIndex> first_order_index(std::span<const double> input,
                                                 std::span<const double> output) {
  detail::check_same_size("output", output, input);
  detail::check_values("input", input, 0);
  detail::check_values("output", output, 0);
  if (input.size() < sensitivity_values_min) return std::nullopt;
  if (!varies(input) || !varies(output)) return std::nullopt;
  return index_of(ascending_order(input), output, noise_level_for(input.size()));
}

std::vector<std::vector<Sensitivity>> sensitivities(std::span<const Column> inputs,
                                                    std::span<const Column> outputs,
                                                    double confidence) {
  std::vector<std::vector<Sensitivity>> all(outputs.size());
  if (inputs.empty() || outputs.empty()) return all;
  const std::vector<std::vector<double>> output_ranks = ranks_of(outputs);
  const double noise_level = noise_level_for(outputs.front().size());
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    detail::check_same_size("input", inputs[i], outputs.front());
    detail::check_values("input", inputs[i], sensitivity_values_min);
    if (!varies(inputs[i])) continue;
    const std::vector<std::size_t> order = ascending_order(inputs[i]);
    const std::vector<double> ranks = average_ranks(inputs[i]);
    for (std::size_t j = 0; j < outputs.size(); ++j) {
      if (output_ranks[j].empty()) continue;
      const auto linear = linear_correlation(inputs[i], outputs[j], confidence);
      const auto rank = correlation_of_ranks(ranks, output_ranks[j], confidence);
      if (!linear || !rank) continue;
      all[j].push_back({i, *linear, *rank, index_of(order, outputs[j], noise_level)});
    }
  }
  for (std::vector<Sensitivity>& of_output : all) {
    std::ranges::stable_sort(of_output, std::greater<>(),
                             [](const Sensitivity& one) { return one.first_order.index; });
  }
  return all;
}

}  // namespace proofmass
