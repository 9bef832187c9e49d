#include "coordinator/report/fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "coordinator/report/report_tables.hpp"
#include "coordinator/report/review_tables.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass::coordinator {

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
