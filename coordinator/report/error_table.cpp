#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include "coordinator/report/report.hpp"
#include "coordinator/report/requirement_text.hpp"
#include "coordinator/report/text_cells.hpp"
#include "core/campaign/model.hpp"
#include "core/statistics/interval.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t label_width = 10;
constexpr std::size_t bias_width = 9;
constexpr std::size_t biases_width = 2 * bias_width + 1;
constexpr std::size_t percentile_width = 8;
constexpr std::size_t percentiles_width = percentile_levels.size() * percentile_width + 1;
constexpr std::size_t from_width = 7;
constexpr std::size_t to_width = 8;
constexpr std::size_t rates_width = from_width + to_width;

std::string heading() {
  std::string levels;
  for (const double level : percentile_levels) {
    levels += right_aligned(fmt::format("{:.0f} %", 100.0 * level), percentile_width);
  }
  const std::string left =
      left_aligned("", label_width) + left_aligned(centred("bias", biases_width), biases_width);
  return fmt::format(
      "{}│{}│{}\n{}{}{} │{} │{}{}\n{}┼{}┼{}\n", left,
      left_aligned(centred("percentiles of |error|", percentiles_width), percentiles_width),
      centred("beyond, %", rates_width), left_aligned("parameter", label_width),
      right_aligned("from", bias_width), right_aligned("to", bias_width), levels,
      right_aligned("from", from_width), right_aligned("to", to_width),
      horizontal_rule(label_width + biases_width), horizontal_rule(percentiles_width),
      horizontal_rule(rates_width));
}

std::string row(const Quantity& quantity, const AccuracyStatistic& accuracy) {
  const double scale = quantity.display_scale;
  const std::optional<Interval>& bias = accuracy.error.bias_interval;
  const auto bias_cell = [&](double bound) {
    return right_aligned(bias ? signed_figure(bound / scale) : "-", bias_width);
  };
  std::string percentiles;
  for (const PercentileStatistic& percentile : accuracy.percentiles) {
    percentiles += right_aligned(measured_figure(percentile.value / scale), percentile_width);
  }
  const Interval& beyond = accuracy.beyond_objective;
  return fmt::format("{}{}{} │{} │{}{}\n", left_aligned(quantity.symbol, label_width),
                     bias_cell(bias ? bias->lower : 0.0), bias_cell(bias ? bias->upper : 0.0),
                     percentiles, right_aligned(measured_figure(100.0 * beyond.lower), from_width),
                     right_aligned(measured_figure(100.0 * beyond.upper), to_width));
}

std::string joint_text(const CampaignStatistics& statistics, std::uint64_t num_given_up) {
  constexpr std::size_t margin = 2;
  return line_of(fmt::format("all objectives together: {} of {} runs,",
                             statistics.num_within_objectives, statistics.num_runs + num_given_up),
                 interval_percent(*statistics.within_objectives(num_given_up)) + " of all draws",
                 margin);
}

}  // namespace

std::string error_table(const CampaignStatistics& statistics, std::uint64_t num_given_up) {
  if (statistics.num_estimated == 0) return "";
  std::string text =
      fmt::format("95 % intervals of bias and of draws beyond the objective\n\n{}", heading());
  for (std::size_t i = 0; i < statistics.accuracy.size(); ++i) {
    text += row(model().results().quantities[i], statistics.accuracy[i]);
  }
  return text + joint_text(statistics, num_given_up);
}

}  // namespace proofmass::coordinator
