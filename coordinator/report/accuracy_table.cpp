#include <fmt/format.h>

#include <cmath>

#include "coordinator/report/report.hpp"
#include "coordinator/report/text_cells.hpp"
#include "core/campaign/model.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t label_width = 11;
constexpr std::size_t unit_width = 9;
constexpr std::size_t objective_width = 9;
constexpr std::size_t measured_width = 8;  // Worst, mean, standard deviation.
constexpr std::size_t beyond_width = 8;
constexpr std::size_t paper_width = 6;
constexpr std::size_t left_width =
    label_width + unit_width + objective_width + 3 * measured_width + beyond_width;
constexpr std::size_t right_width = 3 * paper_width;

std::string titles(std::size_t width) {
  std::string text;
  for (const char* title : {"worst", "mean", "std"}) text += right_aligned(title, width);
  return text;
}

std::string heading() {
  constexpr std::size_t given_width = label_width + unit_width + objective_width;
  const std::string spanning =
      left_aligned("", given_width) + centred("this campaign", left_width - given_width);
  return fmt::format("{}│{}\n{}{}{}{}{}│{}\n{}┼{}\n", left_aligned(spanning, left_width),
                     centred("the paper", right_width), left_aligned("parameter", label_width),
                     left_aligned("unit", unit_width), right_aligned("objective", objective_width),
                     titles(measured_width), right_aligned("beyond ", beyond_width),
                     titles(paper_width), horizontal_rule(left_width),
                     horizontal_rule(right_width));
}

std::string measured_cells(const AccuracyStatistic& accuracy, std::uint64_t num_runs,
                           double scale) {
  std::string text;
  for (const double value : {accuracy.worst, accuracy.mean}) {
    text += right_aligned(measured_figure(value / scale), measured_width);
  }
  text += right_aligned(num_runs < 2 ? "-" : measured_figure(accuracy.standard_deviation / scale),
                        measured_width);
  const std::uint64_t beyond = accuracy.num_beyond_objective;
  const std::string count =
      beyond < 1'000'000 ? std::to_string(beyond) : measured_figure(static_cast<double>(beyond));
  return text + right_aligned(count + " ", beyond_width);
}

std::string absent_cells() {
  std::string text;
  for (int i = 0; i < 3; ++i) text += right_aligned("-", measured_width);
  return text + right_aligned("- ", beyond_width);
}

std::string row(const Quantity& quantity, double objective, const std::string& cells) {
  std::string text =
      left_aligned(quantity.symbol, label_width) + left_aligned(quantity.display_unit, unit_width) +
      right_aligned(
          std::isfinite(objective) ? given_figure(objective / quantity.display_scale) : "-",
          objective_width);
  text += cells + "│";
  if (!quantity.published) return text + "\n";
  const PublishedAccuracy& published = *quantity.published;
  for (const double value : {published.worst, published.mean, published.standard_deviation}) {
    text += right_aligned(given_figure(value / quantity.display_scale), paper_width);
  }
  return text + "\n";
}

}  // namespace

std::string accuracy_table(const Campaign& campaign, const CampaignStatistics& statistics) {
  std::string text =
      fmt::format("Accuracy of calibration: |estimate − truth| of {} {}\n\n",
                  statistics.num_estimated, statistics.num_estimated == 1 ? "run" : "runs");
  text += heading();
  const std::vector<double> objectives = campaign.objectives();
  const std::vector<Quantity>& quantities = model().results().quantities;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    const Quantity& quantity = quantities[i];
    const std::string cells = statistics.num_estimated == 0
                                  ? absent_cells()
                                  : measured_cells(statistics.accuracy[i], statistics.num_estimated,
                                                   quantity.display_scale);
    text += row(quantity, objectives[i], cells);
  }
  return text + "beyond: runs whose error exceeds the objective; the paper: Hardy et al. 2013\n";
}

}  // namespace proofmass::coordinator
