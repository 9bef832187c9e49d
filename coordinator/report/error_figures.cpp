#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>

#include "coordinator/charts/chart.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/report/review.hpp"
#include "coordinator/report/standard_errors.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t num_worst_shown = 5;
constexpr std::size_t num_convergence_points = 40;
constexpr std::uint64_t few_convergence_runs = 5;

}  // namespace

void keep_largest(const RunValue& candidate, std::size_t count, std::vector<RunValue>& largest) {
  if (largest.size() == count && candidate.value <= largest.back().value) return;
  const auto place =
      std::ranges::upper_bound(largest, candidate.value, std::greater<>(), &RunValue::value);
  largest.insert(place, candidate);
  if (largest.size() > count) largest.pop_back();
}

std::vector<std::uint64_t> convergence_counts(std::uint64_t num_runs) {
  std::vector<std::uint64_t> counts;
  if (num_runs == 0) return counts;
  // Of few runs all: one point is no line.
  const double first =
      num_runs > few_convergence_runs ? static_cast<double>(few_convergence_runs) : 1.0;
  const double ratio = static_cast<double>(num_runs) / first;
  for (std::size_t i = 0; i < num_convergence_points; ++i) {
    const double part = static_cast<double>(i) / static_cast<double>(num_convergence_points);
    const auto count = static_cast<std::uint64_t>(std::round(first * std::pow(ratio, part)));
    if (counts.empty() || counts.back() < count) counts.push_back(count);
  }
  if (counts.empty() || counts.back() < num_runs) counts.push_back(num_runs);
  return counts;
}

ErrorFigures::ErrorFigures(std::size_t num_quantities, std::uint64_t num_runs,
                           bool are_draws_independent)
    : are_draws_independent_(are_draws_independent),
      counts_(convergence_counts(num_runs)),
      quantities_(num_quantities) {}

void ErrorFigures::add_error(RunIndex run, double error, Growing& quantity) {
  const double magnitude = std::abs(error);
  quantity.magnitudes.add(magnitude);
  quantity.errors.add(error);
  keep_largest({.run = run, .value = magnitude}, num_worst_shown, quantity.figures.worst);
  if (!quantity.sums) quantity.sums.emplace(magnitude);
  quantity.sums->add(magnitude);
}

void ErrorFigures::add_convergence() {
  for (Growing& quantity : quantities_) {
    const Moments moments = quantity.sums->moments();
    ConvergencePoint& point = quantity.figures.convergence.emplace_back(
        ConvergencePoint{.num_runs = num_estimated_,
                         .worst = quantity.figures.worst.front().value,
                         .mean = moments.mean,
                         .standard_deviation = moments.standard_deviation});
    if (!are_draws_independent_) continue;
    point.mean_interval = mean_interval(moments, default_confidence);
    point.deviation_interval = deviation_interval(moments, default_confidence);
  }
}

void ErrorFigures::add(const RunResult& result) {
  if (!result.is_completed()) return;
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    add_error(result.run, result.error(i), quantities_[i]);
  }
  ++num_estimated_;
  if (next_count_ >= counts_.size() || num_estimated_ < counts_[next_count_]) return;
  ++next_count_;
  add_convergence();
}

std::vector<QuantityFigures> ErrorFigures::figures() {
  // Where runs have no estimate, the last count is not reached.
  const bool has_last = next_count_ > 0 && counts_[next_count_ - 1] == num_estimated_;
  if (num_estimated_ > 0 && !has_last) add_convergence();
  std::vector<QuantityFigures> figures;
  for (Growing& quantity : quantities_) {
    quantity.figures.magnitudes = quantity.magnitudes.histogram();
    quantity.figures.errors = quantity.errors.histogram();
    figures.push_back(std::move(quantity.figures));
  }
  return figures;
}

namespace {

// Of magnitudes.
constexpr int bins_a_decade = 10;
constexpr int first_decade = -120;
constexpr int last_decade = 92;
constexpr std::size_t num_magnitude_bins =
    static_cast<std::size_t>(last_decade - first_decade) * bins_a_decade;

double magnitude_edge(std::size_t bin) {
  const int tenths = first_decade * bins_a_decade + static_cast<int>(bin);
  return std::pow(10.0, static_cast<double>(tenths) / bins_a_decade);
}

// Of errors.
constexpr std::size_t num_error_bins = 64;
constexpr int smallest_exponent = -400;
constexpr int relative_bits = 24;

}  // namespace

MagnitudeBins::MagnitudeBins() : counts_(num_magnitude_bins) {}

void MagnitudeBins::add(double value) {
  const double bin =
      value > 0.0 ? std::floor((std::log10(value) - first_decade) * bins_a_decade) : -1.0;
  if (bin < 0.0) {
    ++num_zero_;
    return;
  }
  ++counts_[static_cast<std::size_t>(std::min(bin, static_cast<double>(num_magnitude_bins - 1)))];
}

Histogram MagnitudeBins::histogram() const {
  Histogram histogram;
  histogram.num_below = num_zero_;
  const auto has_values = [](std::uint64_t count) { return count > 0; };
  const auto begin = std::ranges::find_if(counts_, has_values);
  if (begin == counts_.end()) return histogram;
  const auto end = std::find_if(counts_.rbegin(), counts_.rend(), has_values).base();
  histogram.counts.assign(begin, end);
  const auto first = static_cast<std::size_t>(begin - counts_.begin());
  for (std::size_t i = 0; i <= histogram.counts.size(); ++i) {
    histogram.edges.push_back(magnitude_edge(first + i));
  }
  return histogram;
}

ErrorBins::ErrorBins() : exponent_(smallest_exponent) {}

void ErrorBins::double_width() {
  std::map<double, std::uint64_t> merged;
  for (const auto& [bin, count] : counts_) merged[std::floor(bin / 2.0)] += count;
  counts_ = std::move(merged);
  ++exponent_;
}

void ErrorBins::add(double value) {
  const int least_exponent =
      value == 0.0 ? smallest_exponent : std::ilogb(value) + 1 - relative_bits;
  const auto bin_of = [&] { return std::floor(std::ldexp(value, -exponent_)); };
  const auto has_bin = [&] {
    if (exponent_ < least_exponent) return false;
    constexpr auto span = static_cast<double>(num_error_bins);
    return counts_.empty() || std::max(bin_of(), counts_.rbegin()->first) -
                                      std::min(bin_of(), counts_.begin()->first) <
                                  span;
  };
  while (!has_bin()) double_width();
  ++counts_[bin_of()];
}

Histogram ErrorBins::histogram() const {
  Histogram histogram;
  if (counts_.empty()) return histogram;
  const double first = counts_.begin()->first;
  const double last = counts_.rbegin()->first;
  for (double bin = first; bin <= last; bin += 1.0) {
    const auto place = counts_.find(bin);
    histogram.counts.push_back(place == counts_.end() ? 0 : place->second);
    histogram.edges.push_back(std::ldexp(bin, exponent_));
  }
  histogram.edges.push_back(std::ldexp(last + 1.0, exponent_));
  return histogram;
}

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
  const CampaignStatistics& statistics = review.results.statistics;
  const std::uint64_t beyond = statistics.accuracy[index].num_beyond_objective;
  return fmt::format("{} of {} exceed{} the objective of {}.", beyond,
                     counted(statistics.num_estimated, "completed run"), beyond == 1 ? "s" : "",
                     quantity_text(objective, quantity, 6));
}

std::string worst_sentence(const Review& review, std::size_t index) {
  const std::vector<RunValue>& worst = review.figures[index].worst;
  if (worst.empty()) return "No run has an estimate.";
  const Quantity& quantity = quantity_at(review, index);
  std::string text = "The largest errors are";
  for (std::size_t i = 0; i < worst.size(); ++i) {
    text += fmt::format("{} {} in run {}", i == 0 ? "" : ",",
                        quantity_text(worst[i].value, quantity), worst[i].run.value);
  }
  return text + ".";
}

/// Without the smallest of the values, at most 1 % of those that have a bin: few of them would make
/// most of a logarithmic axis.
Histogram without_smallest(const Histogram& all) {
  const std::uint64_t num_values = std::accumulate(all.counts.begin(), all.counts.end(), 0ULL);
  std::uint64_t num_left_out = 0;
  std::ptrdiff_t first = 0;
  for (const std::uint64_t count : all.counts) {
    if (num_left_out + count > num_values / 100) break;
    num_left_out += count;
    ++first;
  }
  return {.edges = {all.edges.begin() + first, all.edges.end()},
          .counts = {all.counts.begin() + first, all.counts.end()},
          .num_below = all.num_below + num_left_out};
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
  const auto as_text = [&](double value) {
    return quantity_text(value, quantity_at(review, index));
  };
  std::string text =
      fmt::format("After {} the worst is {}, the mean {}", counted(last.num_runs, "run"),
                  as_text(last.worst), as_text(last.mean));
  if (last.mean_interval) {
    text += fmt::format(" (95 %: {} to {})", as_text(std::max(last.mean_interval->lower, 0.0)),
                        as_text(last.mean_interval->upper));
  }
  if (last.num_runs < 2) return text + ".";
  return text + fmt::format(", and the standard deviation {}.", as_text(last.standard_deviation));
}

/// What an overview shows errors in: the objective, or the worst error where there is none.
double overview_scale(const Review& review, std::size_t index) {
  const double objective = review.objectives[index];
  if (std::isfinite(objective)) return objective;
  const std::vector<RunValue>& worst = review.figures[index].worst;
  return !worst.empty() && worst[0].value > 0.0 ? worst[0].value : 1.0;
}

/// Values whose bins lie below a limit, or in none.
std::uint64_t num_below(const Histogram& histogram, double limit) {
  std::uint64_t num = histogram.num_below;
  for (std::size_t i = 0; i < histogram.counts.size() && histogram.edges[i + 1] <= limit; ++i) {
    num += histogram.counts[i];
  }
  return num;
}

/// Half the width of an interval over the value in its middle, percent.
std::optional<double> relative_percent(const std::optional<Interval>& interval, double value) {
  if (!interval || !(value > 0.0)) return std::nullopt;
  return 50.0 * (interval->upper - interval->lower) / value;
}

Chart magnitude_chart(const Review& review, std::size_t index) {
  const Quantity& quantity = quantity_at(review, index);
  const Histogram histogram = without_smallest(review.figures[index].magnitudes);
  const std::string left_out =
      histogram.num_below == 0 ? "" : fmt::format("; {} smaller not shown", histogram.num_below);
  Chart chart{
      .text = {.id = fmt::format("histogram-{}", quantity.name),
               .title = fmt::format("|error| of {}", quantity.symbol),
               .description =
                   fmt::format("Histogram of {}. {} {}",
                               counted(review.results.statistics.num_estimated, "run"),
                               objective_sentence(review, index), worst_sentence(review, index))},
      .x = {.label = axis_label("|error|", quantity) + left_out, .scale = Scale::logarithmic},
      .y = {.label = "runs", .is_count = true}};
  const double objective = review.objectives[index] / quantity.display_scale;
  chart.layers.emplace_back(bars_of(histogram, quantity.display_scale));
  if (std::isfinite(objective)) {
    chart.layers.emplace_back(LimitLine{
        .label = fmt::format("objective {}", figure_text(objective, 6)), .value = objective});
  }
  chart.layers.emplace_back(worst_markers(review, index, quantity.display_scale));
  return chart;
}

Chart error_chart(const Review& review, std::size_t index) {
  const Quantity& quantity = quantity_at(review, index);
  const CampaignStatistics& statistics = review.results.statistics;
  const Histogram& histogram = review.figures[index].errors;
  Chart chart{.text = {.id = fmt::format("error-{}", quantity.name),
                       .title = fmt::format("Error of {}", quantity.symbol)},
              .x = {.label = axis_label("estimate − truth", quantity)},
              .y = {.label = "runs", .is_count = true},
              .layers = {bars_of(histogram, quantity.display_scale)}};
  if (histogram.counts.size() == 1) {  // Equal errors: a line in an axis about it.
    const double at = histogram.edges[0] / quantity.display_scale;
    const double half = at == 0.0 ? 1.0 : std::abs(at);
    chart.x.from = at - half;
    chart.x.to = at + half;
  }
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
      "Histogram of the errors with their signs. The bias is {}{}{}.",
      quantity_text(error.bias, quantity),
      error.bias_interval
          ? fmt::format(" (95 %: {} to {})", quantity_text(error.bias_interval->lower, quantity),
                        quantity_text(error.bias_interval->upper, quantity))
          : "",
      statistics.num_estimated < 2
          ? ""
          : ", the standard deviation " + quantity_text(error.standard_deviation, quantity));
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

}  // namespace

std::vector<Part> error_parts(const Review& review) {
  std::vector<Part> parts;
  const std::vector<Quantity>& quantities = review.schema.quantities;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    const std::string& name = quantities[i].name;
    parts.emplace_back(
        Markup{fmt::format("<h3>{}</h3>\n", wire::markup_text(quantities[i].symbol))});
    parts.emplace_back(NamedPicture{"histogram:" + name, magnitude_chart(review, i)});
    parts.emplace_back(NamedPicture{"error:" + name, error_chart(review, i)});
    parts.emplace_back(NamedPicture{"convergence:" + name, convergence_chart(review, i)});
  }
  return parts;
}

ChartGrid magnitude_overview(const Review& review) {
  const auto has_objective = [](double objective) { return std::isfinite(objective); };
  std::string title = "Errors in units of their objectives (dashed)";
  if (std::ranges::none_of(review.objectives, has_objective)) {
    title = "Errors in units of the worst";
  } else if (!std::ranges::all_of(review.objectives, has_objective)) {
    title += " or, without one, of the worst";
  }
  ChartGrid grid{.text = {.id = "errors", .title = std::move(title)}};
  // One axis for all, so that they can be compared.
  constexpr double from = 1e-4;
  double end = 3.0;
  for (std::size_t i = 0; i < review.figures.size(); ++i) {
    const std::vector<double>& edges = review.figures[i].magnitudes.edges;
    if (!edges.empty()) end = std::max(end, edges.back() / overview_scale(review, i));
  }
  for (std::size_t i = 0; i < review.figures.size(); ++i) {
    const Quantity& quantity = quantity_at(review, i);
    const double objective = review.objectives[i];
    const std::uint64_t num_left_out =
        num_below(review.figures[i].magnitudes, from * overview_scale(review, i));
    Chart chart{
        .text = {.id = fmt::format("errors-{}", quantity.name),
                 .title = std::string(quantity.symbol)},
        .x = {.label = (std::isfinite(objective) ? "|error| / objective" : "|error| / worst") +
                       (num_left_out == 0 ? "" : fmt::format("; {} smaller", num_left_out)),
              .scale = Scale::logarithmic,
              .from = from,
              .to = end},
        .y = {.label = "runs", .is_count = true},
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
               .title = "95 % intervals of mean and std (dashed) of |error|",
               .description =
                   "Half the width of each interval over the value, against the number of runs."}};
  for (std::size_t i = 0; i < review.figures.size(); ++i) {
    Curve mean;
    Curve deviation{.ink = Ink::second, .look = Dash::dashed};
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
