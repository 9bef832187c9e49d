#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "coordinator/report/report.hpp"
#include "coordinator/report/text_cells.hpp"
#include "core/campaign/model.hpp"
#include "core/statistics/tolerance.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t label_width = 11;
constexpr std::size_t figure_width = 8;
constexpr std::size_t triple_width = 3 * figure_width + 1;
constexpr std::size_t bias_width = 9;
constexpr std::size_t skewness_width = 7;
constexpr std::size_t signed_width = bias_width + skewness_width;

std::string triple(std::string_view one, std::string_view two, std::string_view three) {
  return right_aligned(one, figure_width) + right_aligned(two, figure_width) +
         right_aligned(three, figure_width) + " ";
}

// Of |error|: of few runs the symmetric interval of a mean may begin below 0, where none can lie.
std::string triple(double value, const std::optional<Interval>& interval, double scale) {
  const auto figure = [&](double number) { return measured_figure(std::max(number, 0.0) / scale); };
  if (!interval) return triple(figure(value), "-", "-");
  return triple(figure(value), figure(interval->lower), figure(interval->upper));
}

std::string heading() {
  const std::string rule =
      fmt::format("{}┼{}┼{}\n", horizontal_rule(label_width + triple_width),
                  horizontal_rule(triple_width), horizontal_rule(signed_width));
  return fmt::format("{}│{}│{}\n{}{}│{}│{}{}\n{}",
                     left_aligned(left_aligned("", label_width) + centred("|error|", triple_width),
                                  label_width + triple_width),
                     left_aligned(centred("|error|", triple_width), triple_width),
                     centred("error", signed_width), left_aligned("parameter", label_width),
                     triple("mean", "from", "to"), triple("std", "from", "to"),
                     right_aligned("bias", bias_width), right_aligned("skew", skewness_width),
                     rule);
}

std::string row(const Quantity& quantity, const AccuracyStatistic& accuracy,
                std::uint64_t num_runs) {
  const double scale = quantity.display_scale;
  const std::string deviation =
      num_runs < 2 ? triple("-", "-", "-")
                   : triple(accuracy.standard_deviation, accuracy.deviation_interval, scale);
  const std::string skewness = num_runs < 3 ? "-" : fmt::format("{:.2f}", accuracy.error.skewness);
  return fmt::format("{}{}│{}│{}{}\n", left_aligned(quantity.symbol, label_width),
                     triple(accuracy.mean, accuracy.mean_interval, scale), deviation,
                     right_aligned(signed_figure(accuracy.error.bias / scale), bias_width),
                     right_aligned(skewness, skewness_width));
}

/// Fewest runs that the bootstrap covers what it says from; core/statistics/README.md.
constexpr std::uint64_t num_runs_of_bootstrap = 200;

constexpr std::string_view of_one_parameter = "  (one parameter by itself, not all together)\n";

/// What "the worst of n" is worth [Wilks1941].
std::string worth_of_worst(std::uint64_t num_runs, std::uint64_t num_without_estimate) {
  const double coverage = std::pow(1.0 - default_confidence, 1.0 / static_cast<double>(num_runs));
  // Rounded down: no more is claimed than holds.
  const std::string text =
      fmt::format("worst of {}: with 95 % confidence {} % of all draws stay below", num_runs,
                  std::floor(coverage * 1e5) / 1e3);
  if (num_without_estimate == 0) return fmt::format("{}\n{}", text, of_one_parameter);
  return text + fmt::format(",\n  of those that have an estimate; {} more {} none\n{}",
                            num_without_estimate, num_without_estimate == 1 ? "has" : "have",
                            of_one_parameter);
}

}  // namespace

std::string interval_table(const CampaignStatistics& statistics, std::uint64_t num_given_up) {
  if (statistics.num_estimated == 0) return "";
  std::string text = fmt::format("95 % intervals, in the units above\n\n{}", heading());
  for (std::size_t i = 0; i < statistics.accuracy.size(); ++i) {
    text += row(model().results().quantities[i], statistics.accuracy[i], statistics.num_estimated);
  }
  if (statistics.num_estimated < num_runs_of_bootstrap) {
    text += "std: an interval from fewer than 200 runs is too narrow, see core/statistics\n";
  }
  return text + worth_of_worst(statistics.num_estimated,
                               statistics.num_runs - statistics.num_estimated + num_given_up);
}

}  // namespace proofmass::coordinator
