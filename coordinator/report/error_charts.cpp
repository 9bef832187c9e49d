#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "coordinator/charts/ticks.hpp"
#include "coordinator/report/report_tables.hpp"
#include "coordinator/report/review_charts.hpp"
#include "coordinator/table/figures.hpp"

namespace proofmass::coordinator {
namespace {

const Quantity& quantity_at(const Review& review, std::size_t index) {
  return review.schema.quantities[index];
}

/// `|error| of offset, nm`; of a pure number without a unit.
std::string axis_label(std::string_view what, const Quantity& quantity) {
  const std::string unit = quantity.display_unit == "1" ? "" : unit_text(quantity.display_unit);
  return unit.empty() ? std::string(what) : fmt::format("{}, {}", what, unit);
}

Bars bars_of(const Histogram& histogram, double scale) {
  Bars bars;
  for (const double edge : histogram.edges) bars.edges.push_back(edge / scale);
  for (const std::uint64_t count : histogram.counts) {
    bars.heights.push_back(static_cast<double>(count));
  }
  return bars;
}

std::string objective_sentence(const Review& review, std::size_t index) {
  const double objective = review.objectives[index];
  if (!std::isfinite(objective)) return "It has no objective.";
  const Quantity& quantity = quantity_at(review, index);
  const std::uint64_t beyond = review.results.statistics.accuracy[index].num_beyond_objective;
  return fmt::format("{} {} the objective of {}.", beyond,
                     beyond == 1 ? "run exceeds" : "runs exceed",
                     quantity_text(objective, quantity));
}

std::string worst_sentence(const Review& review, std::size_t index) {
  const std::vector<RunValue>& worst = review.figures[index].worst;
  if (worst.empty()) return "No run has an estimate.";
  const Quantity& quantity = quantity_at(review, index);
  std::string text = "The largest errors are";
  for (std::size_t i = 0; i < worst.size(); ++i) {
    text += fmt::format("{} {} in run {}", i == 0 ? "" : ",",
                        figure_text(worst[i].value / quantity.display_scale), worst[i].run.value);
  }
  return text + ".";
}

std::string below_sentence(const Histogram& histogram) {
  if (histogram.num_below == 0) return "";
  return fmt::format(" {} smaller {} not shown.", histogram.num_below,
                     histogram.num_below == 1 ? "error is" : "errors are");
}

/// Marks on the axis.
Curve worst_markers(const Review& review, std::size_t index, double scale) {
  const std::vector<RunValue>& all = review.figures[index].worst;
  Curve markers{
      .name = all.empty() ? "" : fmt::format("worst runs (the worst: run {})", all[0].run.value),
      .ink = Ink::fourth,
      .look = Shape::triangle};
  for (const RunValue& worst : all) markers.points.push_back({worst.value / scale, 0.0});
  return markers;
}

/// The middle of an interval and its ends as lines.
void add_interval(const std::optional<Interval>& interval, double value, double scale,
                  std::string_view label, Chart& chart) {
  chart.layers.emplace_back(LimitLine{
      .label = std::string(label), .value = value / scale, .ink = Ink::third, .dash = Dash::solid});
  if (!interval) return;
  for (const double end : {interval->lower, interval->upper}) {
    chart.layers.emplace_back(
        LimitLine{.value = end / scale, .ink = Ink::third, .dash = Dash::dotted});
  }
}

void add_to_band(double num_runs, const std::optional<Interval>& interval, double scale,
                 Band& band) {
  if (!interval) return;
  band.points.push_back(
      {num_runs, std::max(interval->lower, 0.0) / scale, interval->upper / scale});
}

std::string convergence_sentence(const Review& review, std::size_t index) {
  const std::vector<ConvergencePoint>& points = review.figures[index].convergence;
  if (points.empty()) return "No run has an estimate.";
  const ConvergencePoint& last = points.back();
  const double scale = quantity_at(review, index).display_scale;
  std::string text =
      fmt::format("After {} the worst is {}, the mean {}", counted(last.num_runs, "run"),
                  figure_text(last.worst / scale), figure_text(last.mean / scale));
  if (last.mean_interval) {
    text += fmt::format(" (95 %: {} to {})",
                        figure_text(std::max(last.mean_interval->lower, 0.0) / scale),
                        figure_text(last.mean_interval->upper / scale));
  }
  return text + fmt::format(", and the standard deviation {}.",
                            quantity_text(last.standard_deviation, quantity_at(review, index)));
}

/// What an overview shows errors in: the objective, or the worst error where there is none.
double overview_scale(const Review& review, std::size_t index) {
  const double objective = review.objectives[index];
  if (std::isfinite(objective)) return objective;
  const std::vector<RunValue>& worst = review.figures[index].worst;
  return !worst.empty() && worst[0].value > 0.0 ? worst[0].value : 1.0;
}

/// Half the width of an interval over the value in its middle, percent.
std::optional<double> relative_percent(const std::optional<Interval>& interval, double value) {
  if (!interval || !(value > 0.0)) return std::nullopt;
  return 50.0 * (interval->upper - interval->lower) / value;
}

}  // namespace

Chart magnitude_chart(const Review& review, std::size_t index) {
  const Quantity& quantity = quantity_at(review, index);
  const Histogram& histogram = review.figures[index].magnitudes;
  Chart chart{.text = {.id = fmt::format("histogram-{}", quantity.name),
                       .title = fmt::format("|error| of {}", quantity.symbol),
                       .description =
                           fmt::format("Histogram of {}. {} {}{}",
                                       counted(review.results.statistics.num_estimated, "run"),
                                       objective_sentence(review, index),
                                       worst_sentence(review, index), below_sentence(histogram))},
              .x = {.label = axis_label("|error|", quantity), .scale = Scale::logarithmic},
              .y = {.label = "runs"}};
  const double objective = review.objectives[index] / quantity.display_scale;
  chart.layers.emplace_back(bars_of(histogram, quantity.display_scale));
  if (std::isfinite(objective)) {
    chart.layers.emplace_back(LimitLine{
        .label = fmt::format("objective {}", figure_text(objective)), .value = objective});
  }
  chart.layers.emplace_back(worst_markers(review, index, quantity.display_scale));
  return chart;
}

Chart error_chart(const Review& review, std::size_t index) {
  const Quantity& quantity = quantity_at(review, index);
  const CampaignStatistics& statistics = review.results.statistics;
  Chart chart{.text = {.id = fmt::format("error-{}", quantity.name),
                       .title = fmt::format("Error of {}", quantity.symbol)},
              .x = {.label = axis_label("estimate − truth", quantity)},
              .y = {.label = "runs"},
              .layers = {bars_of(review.figures[index].errors, quantity.display_scale)}};
  if (statistics.num_estimated == 0) {
    chart.text.description = "No run has an estimate.";
    return chart;
  }
  const ErrorStatistic& error = statistics.accuracy[index].error;
  const double scale = quantity.display_scale;
  add_interval(error.bias_interval, error.bias, scale,
               fmt::format("bias {}{}", figure_text(error.bias / scale),
                           error.bias_interval ? " with 95 % interval" : ""),
               chart);
  chart.text.description = fmt::format(
      "Histogram of the errors with their signs. The bias is {}{}, the standard deviation {}.",
      figure_text(error.bias / scale),
      error.bias_interval
          ? fmt::format(" (95 %: {} to {})", figure_text(error.bias_interval->lower / scale),
                        figure_text(error.bias_interval->upper / scale))
          : "",
      quantity_text(error.standard_deviation, quantity));
  return chart;
}

Chart convergence_chart(const Review& review, std::size_t index) {
  const Quantity& quantity = quantity_at(review, index);
  const double scale = quantity.display_scale;
  Curve worst{.name = "worst", .ink = Ink::second, .look = Dash::dashed};
  Curve mean{.name = "mean", .ink = Ink::first};
  Curve deviation{.name = "std", .ink = Ink::third, .look = Dash::dotted};
  Band mean_band{.name = "mean, 95 %"};
  Band deviation_band{.name = "std, 95 %", .ink = Ink::third};
  for (const ConvergencePoint& point : review.figures[index].convergence) {
    const auto n = static_cast<double>(point.num_runs);
    worst.points.push_back({n, point.worst / scale});
    mean.points.push_back({n, point.mean / scale});
    add_to_band(n, point.mean_interval, scale, mean_band);
    if (point.num_runs < 2) continue;
    deviation.points.push_back({n, point.standard_deviation / scale});
    add_to_band(n, point.deviation_interval, scale, deviation_band);
  }
  Chart chart{.text = {.id = fmt::format("convergence-{}", quantity.name),
                       .title = fmt::format("Convergence of {}", quantity.symbol),
                       .description = convergence_sentence(review, index)},
              .x = {.label = "runs", .scale = Scale::logarithmic},
              .y = {.label = axis_label("|error|", quantity), .from = 0.0}};
  for (Band* const band : {&mean_band, &deviation_band}) {
    if (!band->points.empty()) chart.layers.emplace_back(std::move(*band));
  }
  for (Curve* const curve : {&worst, &mean, &deviation}) {
    chart.layers.emplace_back(std::move(*curve));
  }
  return chart;
}

ChartGrid magnitude_overview(const Review& review) {
  ChartGrid grid{.text = {.id = "errors", .title = "Errors in units of their objectives"}};
  // One axis for all, so that they can be compared.
  double end = 3.0;
  for (std::size_t i = 0; i < review.figures.size(); ++i) {
    const std::vector<double>& edges = review.figures[i].magnitudes.edges;
    if (!edges.empty()) end = std::max(end, edges.back() / overview_scale(review, i));
  }
  for (std::size_t i = 0; i < review.figures.size(); ++i) {
    const Quantity& quantity = quantity_at(review, i);
    const double objective = review.objectives[i];
    Chart chart{.text = {.id = fmt::format("errors-{}", quantity.name),
                         .title = std::string(quantity.symbol)},
                .x = {.label = std::isfinite(objective) ? "|error| / objective" : "|error| / worst",
                      .scale = Scale::logarithmic,
                      .from = 1e-4,
                      .to = end},
                .layers = {bars_of(review.figures[i].magnitudes, overview_scale(review, i))},
                .plot_height = 70.0};
    if (std::isfinite(objective)) chart.layers.emplace_back(LimitLine{.value = 1.0});
    grid.charts.push_back(std::move(chart));
    grid.text.description +=
        fmt::format("{}{}: {}", i == 0 ? "" : " ", quantity.symbol, objective_sentence(review, i));
  }
  return grid;
}

ChartGrid convergence_overview(const Review& review) {
  ChartGrid grid{
      .text = {.id = "convergence",
               .title = "95 % intervals of mean and std of |error|",
               .description =
                   "Half the width of each interval over the value, against the number of runs."}};
  for (std::size_t i = 0; i < review.figures.size(); ++i) {
    Curve mean{.name = i == 0 ? "mean" : ""};
    Curve deviation{.name = i == 0 ? "std" : "", .ink = Ink::second, .look = Dash::dashed};
    for (const ConvergencePoint& point : review.figures[i].convergence) {
      const auto n = static_cast<double>(point.num_runs);
      if (const auto width = relative_percent(point.mean_interval, point.mean)) {
        mean.points.push_back({n, *width});
      }
      if (const auto width = relative_percent(point.deviation_interval, point.standard_deviation)) {
        deviation.points.push_back({n, *width});
      }
    }
    grid.charts.push_back(
        {.text = {.id = fmt::format("convergence-of-{}", quantity_at(review, i).name),
                  .title = std::string(quantity_at(review, i).symbol)},
         .x = {.label = "runs", .scale = Scale::logarithmic},
         .y = {.label = "± %", .from = 0.0, .to = 100.0},
         .layers = {std::move(mean), std::move(deviation)},
         .plot_height = 90.0});
  }
  return grid;
}

}  // namespace proofmass::coordinator
