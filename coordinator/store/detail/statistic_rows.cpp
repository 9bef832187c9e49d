#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/rows.hpp"
#include "coordinator/store/detail/store_impl.hpp"
#include "coordinator/store/store.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator::detail {
namespace {

double entry_of(const Budget& budget, std::size_t i) {
  return i < budget.entries.size() ? budget.entries[i] : budget.total;
}

std::optional<double> entry_of(const std::optional<Budget>& budget, std::size_t i) {
  return budget ? std::optional(entry_of(*budget, i)) : std::nullopt;
}

constexpr int num_statistic_columns = 33;

void put(const ErrorStatistic& error, Statement& row) {
  row.put(error.bias);
  row.put(error.bias_interval);
  row.put(error.rms);
  row.put(error.standard_deviation);
  row.put(error.deviation_interval);
  row.put(error.skewness);
}

void put(const AccuracyStatistic& accuracy, Statement& row) {
  row.put(accuracy.worst);
  row.put(accuracy.worst_run.value);
  row.put(accuracy.num_beyond_objective);
  row.put(std::optional(accuracy.beyond_objective));
  row.put(accuracy.mean);
  row.put(accuracy.mean_interval);
  row.put(accuracy.standard_deviation);
  row.put(accuracy.deviation_interval);
  for (const PercentileStatistic& percentile : accuracy.percentiles) {
    row.put(percentile.value);
    row.put(percentile.interval);
  }
  put(accuracy.error, row);
}

bool is_worse(const RankedRun& left, const RankedRun& right) {
  if (left.magnitude != right.magnitude) return left.magnitude > right.magnitude;
  return left.run < right.run;
}

}  // namespace

void replace_statistics(Database& database, const ResultSchema& results,
                        const CampaignStatistics& statistics) {
  database.execute("DELETE FROM statistic");
  if (statistics.num_estimated == 0) return;
  Statement row = database.prepare(
      fmt::format("INSERT INTO statistic VALUES ({})", places(num_statistic_columns)));
  for (std::size_t i = 0; i < statistics.accuracy.size(); ++i) {
    row.put(results.quantities[i].name);
    row.put(statistics.num_estimated);
    put(statistics.accuracy[i], row);
    row.finish();
  }
}

void replace_summary(const Database& database, const CampaignStatistics& statistics,
                     const ResultDigests& digests) {
  const std::uint64_t num_given_up = database.count("SELECT count(*) FROM run_failure");
  database
      .prepare(
          "INSERT OR REPLACE INTO summary (summary_id, num_finished, num_estimated,"
          " num_not_converged, num_not_finite, num_no_draw, num_lost, num_given_up,"
          " num_within_objectives, within_objectives_lower, within_objectives_upper, digest,"
          " health_digest)"
          " VALUES (1, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)")
      .run(statistics.num_runs, statistics.num_estimated, statistics.num_not_converged,
           statistics.num_not_finite, statistics.num_no_draw, statistics.num_lost, num_given_up,
           statistics.num_within_objectives, statistics.within_objectives(num_given_up),
           digests.results, digests.health);
}

void replace_warnings(Database& database, const ResultSchema& results,
                      std::span<const RunWarning> warnings) {
  database.execute("DELETE FROM run_warning");
  Statement insert = database.prepare("INSERT INTO run_warning VALUES (?, ?, ?, ?)");
  for (const auto& [run, warning] : warnings) {
    insert.run(run.value, warning.effect, results.quantities[warning.quantity].name, warning.part);
  }
}

void replace_budgets(Database& database, const std::optional<ErrorBudget>& budget,
                     const CampaignStatistics& statistics) {
  database.execute("DELETE FROM budget_entry");
  if (!budget) return;
  const BudgetColumns columns = budget_columns(*budget, statistics);
  Statement insert =
      database.prepare("INSERT INTO budget_entry VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (std::size_t i = 0; i <= budget->terms.size(); ++i) {
    const BudgetEntryInfo& info =
        i < budget->terms.size() ? budget->terms[i].info : budget->total_info;
    insert.run(i + 1, info.name, info.label, entry_of(columns.before, i),
               entry_of(columns.after_worst, i), entry_of(columns.after_mean, i), info.paper_before,
               info.paper_after_worst, info.paper_after_mean);
  }
}

WorstRuns::Change WorstRuns::offer(const RankedRun& offered) {
  const bool is_full = runs_.size() == num_worst_runs;
  if (is_full && !is_worse(offered, runs_.back())) return {};
  Change change{.is_taken = true, .dropped = std::nullopt};
  if (is_full) {
    change.dropped = runs_.back().run;
    runs_.pop_back();
  }
  runs_.insert(std::upper_bound(runs_.begin(), runs_.end(), offered, is_worse), offered);
  return change;
}

WorstRunTable read_worst_runs(const Database& database, const ResultSchema& results) {
  Statement select =
      database.prepare("SELECT magnitude, run_index FROM worst_run WHERE parameter = ?");
  WorstRunTable table;
  for (const Quantity& quantity : results.quantities) {
    WorstRuns& worst = table.emplace_back();
    select.bind_all(quantity.name);
    while (select.step()) {
      worst.offer({.magnitude = select.real(0), .run = RunIndex{select.count(1)}});
    }
  }
  return table;
}

std::vector<double> read_objectives(const Database& database, const ResultSchema& results) {
  Statement select = database.prepare("SELECT objective FROM parameter WHERE parameter = ?");
  std::vector<double> objectives;
  for (const Quantity& quantity : results.quantities) {
    select.bind_all(quantity.name);
    if (!select.step()) database.refuse("is damaged: it lacks a parameter");
    objectives.push_back(select.optional_real(0).value_or(std::numeric_limits<double>::infinity()));
    select.finish();
  }
  return objectives;
}

std::uint64_t exceeded_objectives(const RunResult& result, std::span<const double> objectives) {
  std::uint64_t exceeded = 0;
  if (!result.is_completed()) return exceeded;
  for (std::size_t i = 0; i < objectives.size(); ++i) {
    const bool is_beyond = std::abs(result.error(i)) > objectives[i];
    exceeded |= std::uint64_t{is_beyond} << i;
  }
  return exceeded;
}

LargestErrorRows::LargestErrorRows(const Database& database, const ResultSchema& results)
    : schema_(results),
      objectives_(read_objectives(database, results)),
      worst_(read_worst_runs(database, results)),
      insert_overrun_(database.prepare("INSERT INTO overrun VALUES (?, ?)")),
      insert_worst_(database.prepare("INSERT INTO worst_run VALUES (?, ?, ?)")),
      delete_worst_(
          database.prepare("DELETE FROM worst_run WHERE parameter = ? AND run_index = ?")) {}

void LargestErrorRows::add(const RunResult& result) {
  if (!result.is_completed()) return;
  const std::uint64_t exceeded = exceeded_objectives(result, objectives_);
  if (exceeded != 0) insert_overrun_.run(result.run.value, exceeded);
  for (std::size_t i = 0; i < worst_.size(); ++i) {
    const double magnitude = std::abs(result.error(i));
    const std::string& name = schema_.quantities[i].name;
    const WorstRuns::Change change = worst_[i].offer({.magnitude = magnitude, .run = result.run});
    if (change.dropped) delete_worst_.run(name, change.dropped->value);
    if (change.is_taken) insert_worst_.run(name, result.run.value, magnitude);
  }
}

}  // namespace proofmass::coordinator::detail

// What a Store keeps of its results, and how that is held against what it should be.

namespace proofmass::coordinator {

using detail::ComparedTable;
using detail::Database;

namespace {

void replace_all(Database& database, const ResultSchema& schema,
                 const CampaignStatistics& statistics, const std::optional<ErrorBudget>& budget) {
  detail::replace_statistics(database, schema, statistics);
  detail::replace_budgets(database, budget, statistics);
}

// A file that was made before version 9 keeps the budget of the program that made it.
bool has_own_budget(const Database& database) {
  return database.integer("SELECT first_version > 8 FROM campaign") != 0;
}

}  // namespace

void Store::write_statistics(const CampaignStatistics& statistics,
                             const std::optional<ErrorBudget>& budget, const ResultDigests& digests,
                             std::span<const RunWarning> warnings) {
  impl_->commit([&](Database& database) {
    replace_all(database, schema(), statistics, budget);
    detail::replace_summary(database, statistics, digests);
    detail::replace_warnings(database, schema(), warnings);
  });
}

std::optional<Summary> Store::summary() const {
  detail::Statement select = impl_->database.prepare(
      "SELECT num_finished, num_estimated, num_not_converged, num_not_finite, num_no_draw,"
      " num_given_up, digest, computed_utc, num_lost, health_digest, num_within_objectives,"
      " within_objectives_lower, within_objectives_upper FROM summary");
  if (!select.step()) return std::nullopt;
  return Summary{.num_finished = select.count(0),
                 .num_estimated = select.count(1),
                 .num_not_converged = select.count(2),
                 .num_not_finite = select.count(3),
                 .num_no_draw = select.count(4),
                 .num_lost = select.count(8),
                 .num_given_up = select.count(5),
                 .num_within_objectives = select.count(10),
                 .within_objectives = select.interval(11),
                 .digests = {.results = select.text(6), .health = select.text(9)},
                 .computed_utc = select.text(7)};
}

std::vector<std::string> Store::parameter_differences(const Campaign& campaign) const {
  constexpr std::array tables{
      ComparedTable{.name = "parameter", .row_name = "parameter"},
      ComparedTable{.name = "budget_coefficient", .row_name = "parameter || ' in ' || term"}};
  return detail::table_differences(
      impl_->database, impl_->kind,
      [&](Database& expected) { detail::insert_parameters(expected, campaign); },
      std::span(tables).first(has_own_budget(impl_->database) ? 2 : 1));
}

// Intervals are of functions whose last bits depend on the processor, see
// core/statistics/distribution.hpp.
constexpr double rounding = 1e-12;

std::vector<std::string> Store::statistic_differences(const CampaignStatistics& statistics,
                                                      const std::optional<ErrorBudget>& budget,
                                                      std::span<const RunWarning> warnings) const {
  constexpr std::array tables{
      ComparedTable{.name = "statistic", .row_name = "parameter", .tolerance = rounding},
      ComparedTable{.name = "budget_entry", .row_name = "term", .tolerance = rounding},
      ComparedTable{.name = "run_warning",
                    .row_name = "effect || ' on ' || parameter || ' in run ' || run_index",
                    .tolerance = rounding}};
  return detail::table_differences(
      impl_->database, impl_->kind,
      [&](Database& expected) {
        replace_all(expected, schema(), statistics, budget);
        detail::replace_warnings(expected, schema(), warnings);
      },
      std::span(tables).first(has_own_budget(impl_->database) ? 3 : 1));
}

std::vector<std::string> Store::stop_check_differences(
    std::span<const StopCheckRow> expected) const {
  constexpr std::array tables{
      ComparedTable{.name = "stop_check",
                    .row_name = "statistic || ' after ' || num_runs || ' runs'",
                    .columns = "estimate, lower, upper, relative_half_width, is_reached",
                    .tolerance = rounding}};
  return detail::table_differences(
      impl_->database, impl_->kind,
      [&](Database& database) {
        for (const StopCheckRow& row : expected) {
          detail::replace_stop_check(database, row.num_runs, row.statistic, row.check);
        }
      },
      tables, detail::FurtherRows::ignore);
}

bool Store::has_statistics() const {
  return impl_->database.integer("SELECT EXISTS (SELECT 1 FROM statistic)") != 0;
}

}  // namespace proofmass::coordinator
