#include "coordinator/report/standard_errors.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "coordinator/charts/ticks.hpp"
#include "coordinator/report/report_tables.hpp"
#include "coordinator/table/figures.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass::coordinator {
namespace {

double share_within(const StandardErrorStatistic& statistic) {
  return static_cast<double>(statistic.num_within) / static_cast<double>(statistic.num_runs);
}

Chart pull_chart(const Quantity& quantity, const StandardErrorStatistic& statistic, bool is_first) {
  const Histogram& histogram = statistic.pulls;
  Bars bars{.edges = histogram.edges};
  Curve law{.name = is_first ? "normal law" : "", .ink = Ink::second, .look = Dash::dashed};
  for (std::size_t i = 0; i < histogram.counts.size(); ++i) {
    bars.heights.push_back(static_cast<double>(histogram.counts[i]));
    const double from = histogram.edges[i], to = histogram.edges[i + 1];
    law.points.push_back(
        {0.5 * (from + to), static_cast<double>(statistic.num_runs) *
                                (normal_cumulative(to) - normal_cumulative(from))});
  }
  return {
      .text = {.id = fmt::format("pull-{}", quantity.name), .title = std::string(quantity.symbol)},
      .x = {.label = "error / standard error"},
      .y = {.label = "runs"},
      .layers = {std::move(bars), std::move(law),
                 LimitLine{.value = -normal_95, .ink = Ink::text, .dash = Dash::dotted},
                 LimitLine{.value = normal_95, .ink = Ink::text, .dash = Dash::dotted}},
      .plot_height = 90.0};
}

}  // namespace

void leave_out_intervals(StandardErrorStatistics& statistics) {
  for (StandardErrorStatistic& statistic : statistics.quantities) {
    statistic.squared_ratio_error.reset();
    statistic.within.reset();
  }
  for (FitStatistic& of : statistics.fit) {
    of.ratio_error.reset();
    of.p_value.reset();
  }
}

RunningStandardErrors::RunningStandardErrors(const ResultSchema& schema) : fit_(schema) {
  for (std::size_t i = 0; i < schema.quantities.size(); ++i) {
    if (schema.quantities[i].has_standard_error) indices_.push_back(i);
  }
}

void RunningStandardErrors::add(const RunResult& result) {
  if (!result.is_completed() || result.standard_error.empty()) return;
  ++num_runs_;
  quantities_.resize(indices_.size());
  for (std::size_t i = 0; i < indices_.size(); ++i) {
    const double error = result.error(indices_[i]);
    const double sigma = result.standard_error[i];
    Sums& sums = quantities_[i];
    sums.errors += sigma;
    sums.squares += sigma * sigma;
    sums.squared_errors += error * error;
    sums.fourth_powers += sigma * sigma * sigma * sigma;
    if (std::abs(error) < normal_95 * sigma) ++sums.num_within;
    if (sigma > 0.0 && is_in_range(error / sigma)) sums.pulls.add(error / sigma);
  }
  fit_.add(result);
}

StandardErrorStatistics RunningStandardErrors::statistics() const {
  StandardErrorStatistics statistics;
  const auto n = static_cast<double>(num_runs_);
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    const Sums& sums = quantities_[i];
    const double mean_square = sums.squares / n, squared_error = sums.squared_errors / n;
    const auto over_square = [&](double x) {
      return mean_square > 0.0 ? std::optional(x / mean_square) : std::nullopt;
    };
    statistics.quantities.push_back(
        {.quantity = indices_[i],
         .num_runs = num_runs_,
         .mean = sums.errors / n,
         .squared_ratio = over_square(squared_error),
         .squared_ratio_error = over_square(std::sqrt(2.0 * sums.fourth_powers) / n),
         .num_within = sums.num_within,
         .within =
             probability_interval(static_cast<double>(sums.num_within), n, default_confidence),
         .pulls = sums.pulls.histogram()});
  }
  statistics.fit = fit_.statistics();
  return statistics;
}

Table standard_error_table(const ResultSchema& schema, const StandardErrorStatistics& statistics) {
  if (statistics.quantities.empty()) return {};
  // Draws that are not independent have no standard error of the ratio; those of a design may have
  // intervals from its replicates. Without noise there is not even a ratio.
  const bool have_ratio_errors =
      std::ranges::any_of(statistics.quantities,
                          [](const auto& of) { return of.squared_ratio_error.has_value(); }) ||
      std::ranges::none_of(statistics.quantities,
                           [](const auto& of) { return of.squared_ratio.has_value(); });
  const bool have_intervals = std::ranges::any_of(
      statistics.quantities, [](const auto& of) { return of.within.has_value(); });
  constexpr const char* ratio = "Σerror²/Σσ²";
  constexpr const char* within = "within 1.96 σ, %";
  Table table{.id = "standard-error-table",
              .caption = fmt::format("Standard errors σ of the estimates of {}",
                                     counted(statistics.quantities.front().num_runs, "run")),
              .columns = {{"parameter", true, 11},
                          {"unit", true, 9},
                          {"mean", false, 9},
                          {"ratio", false, 10, ratio, true}},
              .notes = {"honest ones of normal errors have a ratio of 1, and 95 % of the errors "
                        "within"}};
  if (have_ratio_errors) table.columns.push_back({"±", false, 9, ratio});
  table.columns.push_back({"runs", false, have_intervals ? 9U : 18U, within, true});
  if (have_intervals) {
    table.columns.insert(table.columns.end(),
                         {{"from", false, 9, within}, {"to", false, 9, within}});
    if (have_ratio_errors) {
      table.notes.back() +=
          "; ±: its standard deviation; from, to: 95 % interval, which one honest one in twenty "
          "misses";
    }
    if (!have_ratio_errors) table.notes.emplace_back("from, to: 95 % interval from replicates");
  }
  for (const StandardErrorStatistic& statistic : statistics.quantities) {
    const Quantity& quantity = schema.quantities[statistic.quantity];
    Row row{quantity.symbol, unit_cell(quantity),
            figure_cell(statistic.mean, quantity.display_scale),
            figure_cell(statistic.squared_ratio)};
    if (have_ratio_errors) row.push_back(figure_cell(statistic.squared_ratio_error));
    row.push_back(figure_cell(share_within(statistic), 0.01));
    if (have_intervals) add_ends(statistic.within, 0.01, row);
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::vector<Table> standard_error_tables(const ResultSchema& schema,
                                         const StandardErrorStatistics& statistics) {
  return {standard_error_table(schema, statistics), fit_table(schema, statistics.fit)};
}

std::optional<ChartGrid> pull_overview(const ResultSchema& schema,
                                       const StandardErrorStatistics& statistics) {
  if (statistics.quantities.empty()) return std::nullopt;
  ChartGrid grid{.text = {.id = "pulls",
                          .title = "Errors in units of their standard errors; dotted: ±1.96",
                          .description = "Histograms beside the normal law of honest standard "
                                         "errors; the lines hold 95 % of it."}};
  for (const StandardErrorStatistic& statistic : statistics.quantities) {
    const Quantity& quantity = schema.quantities[statistic.quantity];
    grid.charts.push_back(pull_chart(quantity, statistic, grid.charts.empty()));
    grid.text.description += fmt::format(" {}: {} % of the runs.", quantity.symbol,
                                         figure_text(100.0 * share_within(statistic)));
  }
  return grid;
}

RunningFit::RunningFit(const ResultSchema& schema)
    : sessions_(schema.fit_parts), tolerance_(schema.fit_tolerance) {
  if (schema.fit.empty()) return;
  sessions_.insert(sessions_.begin(), "all");
  sums_.resize(sessions_.size());
}

void RunningFit::add(const RunResult& result) {
  num_runs_ += 1.0;
  for (std::size_t i = 0; i < sums_.size(); ++i) {
    const double x = result.fit[2 * i], n = result.fit[2 * i + 1];
    Sums& sums = sums_[i];
    sums.x += x;
    sums.n += n;
    sums.xx += x * x;
    sums.xn += x * n;
    sums.nn += n * n;
  }
}

FitStatistic RunningFit::statistic_of(const std::string& session, const Sums& sums) const {
  FitStatistic of{.session = session,
                  .chi_squared = sums.x / num_runs_,
                  .degrees_of_freedom = sums.n / num_runs_};
  // With fewer, the fit adapts to all data, and what is left is rounding.
  constexpr double degrees_min = 1e-6;
  if (of.degrees_of_freedom < degrees_min) return of;
  of.ratio = sums.x / sums.n;
  if (num_runs_ > 1.0) {
    // The delta method: residuals x − ratio·n, whose mean is 0.
    const double scatter = sums.xx - 2.0 * of.ratio * sums.xn + of.ratio * of.ratio * sums.nn;
    of.ratio_error = std::sqrt(std::max(scatter, 0.0) * num_runs_ / (num_runs_ - 1.0)) / sums.n;
  }
  const double one_sided = std::min(chi_square_above(sums.x / (1.0 + tolerance_), sums.n),
                                    chi_square_at_most(sums.x / (1.0 - tolerance_), sums.n));
  of.p_value = std::min(1.0, 2.0 * static_cast<double>(sums_.size()) * one_sided);
  return of;
}

std::vector<FitStatistic> RunningFit::statistics() const {
  std::vector<FitStatistic> fit;
  if (num_runs_ == 0.0) return fit;
  for (std::size_t i = 0; i < sums_.size(); ++i)
    fit.push_back(statistic_of(sessions_[i], sums_[i]));
  return fit;
}

Table fit_table(const ResultSchema& schema, const std::vector<FitStatistic>& fit) {
  if (fit.empty()) return {};
  const bool has_p_values =
      std::ranges::any_of(fit, [](const auto& of) { return of.p_value.has_value(); });
  Table table{.id = "fit-table",
              .caption = "Fit of the estimates to the data of each session",
              .columns = {{"session", true, 16},
                          {"χ²", false, 9},
                          {"degrees", false, 9},
                          {"χ²/degrees", false, 12}},
              .notes = {"χ²: its mean over the runs; degrees of freedom: what is expected of it"}};
  if (has_p_values) {
    table.columns.insert(table.columns.end(), {{"±", false, 9}, {"p", false, 9}, {"", false, 14}});
    table.notes.push_back("±: standard error of the ratio, from its scatter over the runs");
    table.notes.push_back(fmt::format(
        "p: chance that one of {} ratios is so far from 1 although the noise is what the method "
        "takes it for, to {:.2g} %",
        fit.size(), 100.0 * schema.fit_tolerance));
  }
  for (const FitStatistic& of : fit) {
    Cell session(of.session);
    session.document = name_in_symbols(schema, of.session);
    Row row{std::move(session), figure_cell(of.chi_squared), figure_cell(of.degrees_of_freedom),
            of.ratio > 0.0 ? figure_cell(of.ratio) : no_figure()};
    if (has_p_values) {
      const bool is_by_chance = of.p_value.value_or(1.0) >= 1.0 - default_confidence;
      row.push_back(figure_cell(of.ratio_error));
      row.push_back(figure_cell(of.p_value));
      row.emplace_back(is_by_chance ? "" : "does not fit", Tone::bad);
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

}  // namespace proofmass::coordinator
