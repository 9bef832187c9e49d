#include "coordinator/report/standard_errors.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "coordinator/charts/chart.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/table/table.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass::coordinator {
namespace {

double share_within(const StandardErrorStatistic& statistic) {
  return static_cast<double>(statistic.num_within) / static_cast<double>(statistic.num_runs);
}

Chart pull_chart(const Quantity& quantity, const StandardErrorStatistic& statistic) {
  const Histogram& histogram = statistic.pulls;
  Bars bars{.edges = histogram.edges};
  Curve law{.ink = Ink::second, .look = Dash::dashed};
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
      .y = {.label = "runs", .is_count = true},
      .layers = {std::move(bars), std::move(law),
                 LimitLine{.value = -normal_95, .ink = Ink::text, .dash = Dash::dotted},
                 LimitLine{.value = normal_95, .ink = Ink::text, .dash = Dash::dotted}},
      .plot_height = 90.0};
}

}  // namespace

RunningStandardErrors::RunningStandardErrors(const ResultSchema& schema, bool are_draws_independent)
    : are_draws_independent_(are_draws_independent), fit_tolerance_(schema.fit_tolerance) {
  for (std::size_t i = 0; i < schema.quantities.size(); ++i) {
    if (schema.quantities[i].has_standard_error) indices_.push_back(i);
  }
  if (schema.fit.empty()) return;
  sessions_ = schema.fit_parts;
  sessions_.insert(sessions_.begin(), "all");
  fit_.resize(sessions_.size());
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
    if (sums.unit == 0.0 && sigma > 0.0) sums.unit = std::ldexp(1.0, std::ilogb(sigma));
    if (sigma > 0.0) {
      const double square = (sigma / sums.unit) * (sigma / sums.unit);
      sums.fourth_powers += square * square;
    }
    if (std::abs(error) < normal_95 * sigma) ++sums.num_within;
    if (sigma > 0.0 && is_in_range(error / sigma)) sums.pulls.add(error / sigma);
  }
  add_fit(result);
}

void RunningStandardErrors::add_fit(const RunResult& result) {
  for (std::size_t i = 0; i < fit_.size(); ++i) {
    const double x = result.fit[2 * i], n = result.fit[2 * i + 1];
    FitSums& sums = fit_[i];
    sums.x += x;
    sums.n += n;
    sums.xx += x * x;
    sums.xn += x * n;
    sums.nn += n * n;
  }
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
    StandardErrorStatistic& of = statistics.quantities.emplace_back(
        StandardErrorStatistic{.quantity = indices_[i],
                               .num_runs = num_runs_,
                               .mean = sums.errors / n,
                               .squared_ratio = over_square(squared_error),
                               .num_within = sums.num_within,
                               .pulls = sums.pulls.histogram()});
    if (!are_draws_independent_) continue;
    of.squared_ratio_error =
        over_square(std::sqrt(2.0 * sums.fourth_powers) * sums.unit * sums.unit / n);
    of.within = probability_interval(static_cast<double>(sums.num_within), n, default_confidence);
  }
  for (std::size_t i = 0; i < fit_.size() && num_runs_ > 0; ++i) {
    if (has_part(fit_[i])) statistics.fit.push_back(fit_of(sessions_[i], fit_[i]));
  }
  return statistics;
}

// A test of the equivalence principle has no part in the fit of a calibration.
bool RunningStandardErrors::has_part(const FitSums& sums) { return sums.x > 0.0 || sums.n > 0.0; }

FitStatistic RunningStandardErrors::fit_of(const std::string& session, const FitSums& sums) const {
  const auto num_runs = static_cast<double>(num_runs_);
  FitStatistic of{.session = session,
                  .chi_squared = sums.x / num_runs,
                  .degrees_of_freedom = sums.n / num_runs};
  // With fewer, the fit adapts to all data, and what is left is rounding.
  constexpr double degrees_min = 1e-6;
  if (of.degrees_of_freedom < degrees_min) return of;
  of.ratio = sums.x / sums.n;
  if (!are_draws_independent_) return of;
  if (num_runs_ > 1) {
    // The delta method: residuals x − ratio·n, whose mean is 0.
    const double scatter = sums.xx - 2.0 * of.ratio * sums.xn + of.ratio * of.ratio * sums.nn;
    of.ratio_error = std::sqrt(std::max(scatter, 0.0) * num_runs / (num_runs - 1.0)) / sums.n;
  }
  const double one_sided = std::min(chi_square_above(sums.x / (1.0 + fit_tolerance_), sums.n),
                                    chi_square_at_most(sums.x / (1.0 - fit_tolerance_), sums.n));
  const auto num_ratios = static_cast<double>(std::ranges::count_if(fit_, has_part));
  of.p_value = std::min(1.0, 2.0 * num_ratios * one_sided);
  return of;
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
              .rows = std::vector<Row>(statistics.quantities.size()),
              .notes = {"honest ones of normal errors have a ratio of 1, and 95 % of the errors "
                        "within"}};
  const std::vector<StandardErrorStatistic>& all = statistics.quantities;
  const auto quantity = [&](std::size_t i) -> const Quantity& {
    return schema.quantities[all[i].quantity];
  };
  add_column(table, {"parameter", true, 11}, [&](auto i) { return quantity(i).symbol; });
  add_column(table, {"unit", true, 9}, [&](auto i) { return unit_cell(quantity(i)); });
  add_column(table, {"mean", false, 9},
             [&](auto i) { return figure_cell(all[i].mean, quantity(i).display_scale); });
  add_column(table, {"ratio", false, 10, ratio, true},
             [&](auto i) { return figure_cell(all[i].squared_ratio); });
  if (have_ratio_errors) {
    add_column(table, {"±", false, 9, ratio},
               [&](auto i) { return figure_cell(all[i].squared_ratio_error); });
  }
  add_column(table, {"runs", false, have_intervals ? 9U : 18U, within, true},
             [&](auto i) { return figure_cell(share_within(all[i]), percent_scale); });
  const bool have_ratios =
      std::ranges::all_of(all, [](const auto& of) { return of.squared_ratio.has_value(); });
  if (!have_ratios) {
    table.notes.emplace_back("where σ is 0, there is no ratio and no error within");
  }
  if (!have_intervals) return table;
  add_ends(table, {"from", false, 9, within}, {"to", false, 9, within},
           [&](auto i) { return IntervalAndScale(all[i].within, percent_scale); });
  if (have_ratio_errors) {
    table.notes.front() +=
        "; ±: its standard deviation; from, to: 95 % interval, which one honest one in twenty "
        "misses";
  } else {
    table.notes.emplace_back("from, to: 95 % interval from replicates");
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
                          .title = "Errors in standard errors; dashed: normal law; dotted: ±1.96",
                          .description = "Histograms beside the normal law of honest standard "
                                         "errors; the lines hold 95 % of it."}};
  for (const StandardErrorStatistic& statistic : statistics.quantities) {
    const Quantity& quantity = schema.quantities[statistic.quantity];
    grid.charts.push_back(pull_chart(quantity, statistic));
    grid.text.description += fmt::format(" {}: {} % of the runs.", quantity.symbol,
                                         figure_text(100.0 * share_within(statistic)));
  }
  return grid;
}

Table fit_table(const ResultSchema& schema, const std::vector<FitStatistic>& fit) {
  if (fit.empty()) return {};
  const bool has_p_values =
      std::ranges::any_of(fit, [](const auto& of) { return of.p_value.has_value(); });
  Table table{.id = "fit-table",
              .caption = "Fit of the estimates to the data of each session",
              .rows = std::vector<Row>(fit.size()),
              .notes = {"χ²: its mean over the runs; degrees of freedom: what is expected of it"}};
  add_column(table, {"session", true, 16}, [&](auto i) {
    Cell session(fit[i].session);
    session.document = name_in_symbols(schema, fit[i].session);
    return session;
  });
  add_column(table, {"χ²", false, 9}, [&](auto i) { return figure_cell(fit[i].chi_squared); });
  add_column(table, {"degrees", false, 9},
             [&](auto i) { return figure_cell(fit[i].degrees_of_freedom); });
  add_column(table, {"χ²/degrees", false, 12},
             [&](auto i) { return fit[i].ratio > 0.0 ? figure_cell(fit[i].ratio) : no_figure(); });
  if (!has_p_values) return table;
  add_column(table, {"±", false, 9}, [&](auto i) { return figure_cell(fit[i].ratio_error); });
  add_column(table, {"p", false, 9}, [&](auto i) { return figure_cell(fit[i].p_value); });
  add_column(table, {"", false, 14}, [&](auto i) {
    const bool is_by_chance = fit[i].p_value.value_or(1.0) >= 1.0 - default_confidence;
    return Cell(is_by_chance ? "" : "does not fit", Tone::bad);
  });
  table.notes.push_back("±: standard error of the ratio, from its scatter over the runs");
  table.notes.push_back(fmt::format(
      "p: chance that one of {} ratios is so far from 1, by the law of χ², although the noise is "
      "what the method takes it for, to {:.2g} %",
      fit.size(), 100.0 * schema.fit_tolerance));
  return table;
}

}  // namespace proofmass::coordinator
