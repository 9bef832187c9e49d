#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

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
                     std::uint64_t num_given_up, const ResultDigests& digests) {
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

void replace_stop_check(const Database& database, std::uint64_t num_runs,
                        std::string_view statistic, const StopCheck& check) {
  database
      .prepare(
          "INSERT OR REPLACE INTO stop_check (statistic, num_runs, estimate, lower, upper,"
          " relative_half_width, is_reached) VALUES (?, ?, ?, ?, ?, ?, ?)")
      .run(statistic, num_runs, check.estimate, check.interval, check.relative_half_width,
           std::int64_t{check.is_reached});
}

}  // namespace

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

bool offer(std::vector<RankedRun>& worst, const RankedRun& offered) {
  if (worst.size() >= num_worst_runs && !is_worse(offered, worst.back())) return false;
  worst.insert(std::upper_bound(worst.begin(), worst.end(), offered, is_worse), offered);
  if (worst.size() > num_worst_runs) worst.pop_back();
  return true;
}

WorstRunTable read_worst_runs(const Database& database, const ResultSchema& results) {
  WorstRunTable table;
  for (const Quantity& quantity : results.quantities) {
    table.push_back(structs_of<RankedRun, 2>(
        database,
        "SELECT magnitude, run_index FROM worst_run WHERE parameter = ? ORDER BY 1 DESC, 2",
        quantity.name));
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
      trim_worst_(database.prepare(
          "DELETE FROM worst_run WHERE parameter = ?1 AND run_index IN (SELECT run_index"
          " FROM worst_run WHERE parameter = ?1 ORDER BY magnitude DESC, run_index"
          " LIMIT -1 OFFSET ?2)")) {}

void LargestErrorRows::add(const RunResult& result) {
  if (!result.is_completed()) return;
  const std::uint64_t exceeded = exceeded_objectives(result, objectives_);
  if (exceeded != 0) insert_overrun_.run(result.run.value, exceeded);
  for (std::size_t i = 0; i < worst_.size(); ++i) {
    const double magnitude = std::abs(result.error(i));
    if (!offer(worst_[i], {.magnitude = magnitude, .run = result.run})) continue;
    const std::string& name = schema_.quantities[i].name;
    insert_worst_.run(name, result.run.value, magnitude);
    trim_worst_.run(name, std::uint64_t{num_worst_runs});
  }
}

}  // namespace proofmass::coordinator::detail

// What a Store keeps of its results, and how that is held against what it should be.

namespace proofmass::coordinator {

using detail::Database;
using detail::Statement;

namespace {

void replace_all(Database& database, const ResultSchema& schema,
                 const CampaignStatistics& statistics, const std::optional<ErrorBudget>& budget,
                 std::span<const RunWarning> warnings) {
  detail::replace_statistics(database, schema, statistics);
  detail::replace_budgets(database, budget, statistics);
  detail::replace_warnings(database, schema, warnings);
}

// A file that was made before version 9 keeps the budget of the program that made it.
bool has_own_budget(const Database& database) {
  return database.integer("SELECT first_version > 8 FROM campaign") != 0;
}

/// What is compared of a table.
struct ComparedTable {
  std::string_view name;
  std::string_view row_name;       ///< An SQL expression that no two rows share: `parameter`.
  std::string_view columns = "*";  ///< All of them, or `a, b`.
  double tolerance = 0.0;          ///< Relative, of numbers; 0: their bits are equal.
  bool may_have_further_rows = false;
};

// Intervals are of functions whose last bits depend on the processor, see
// core/statistics/distribution.hpp.
constexpr double rounding = 1e-12;

/// Numbers that agree but for what another processor or another version of Boost.Math rounds.
bool agree(const std::string& stored, const std::string& expected, double tolerance) {
  if (stored == expected) return true;
  const auto number_in = [](const std::string& text) {
    double number = std::numeric_limits<double>::quiet_NaN();
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    return end == text.data() + text.size() ? number : std::numeric_limits<double>::quiet_NaN();
  };
  const double a = number_in(stored), b = number_in(expected);
  return std::abs(a - b) <= tolerance * std::max(std::abs(a), std::abs(b));
}

void compare(const Database& stored_in, const Database& expected_in, const ComparedTable& table,
             std::vector<std::string>& differences) {
  const std::string sql =
      fmt::format("SELECT {}, {} FROM {}", table.row_name, table.columns, table.name);
  std::map<std::string, std::vector<std::string>> stored;  // Cells by the name of the row.
  for (Statement row = stored_in.prepare(sql); row.step();) {
    std::vector<std::string>& cells = stored[row.text(0)];
    for (int i = 0; i < row.num_columns(); ++i) cells.push_back(row.shown(i));
  }
  for (Statement must = expected_in.prepare(sql); must.step();) {
    const std::string name = must.text(0);  // Of the only row of a table: nothing.
    const auto row = stored.find(name);
    if (row == stored.end()) {
      differences.push_back(fmt::format("{} lacks {}", table.name, name));
      continue;
    }
    for (int i = 1; i < must.num_columns(); ++i) {
      const std::string& cell = row->second[static_cast<std::size_t>(i)];
      if (agree(cell, must.shown(i), table.tolerance)) continue;
      differences.push_back(fmt::format("{}.{}{} = {} (must be {})", table.name,
                                        must.column_name(i), name.empty() ? name : " of " + name,
                                        cell, must.shown(i)));
    }
    stored.erase(row);
  }
  if (table.may_have_further_rows) return;
  for (const auto& [name, cells] : stored) {
    differences.push_back(fmt::format("{} has a row too many: {}", table.name, name));
  }
}

/// What tables have other than they would have in a new file, a line each: `statistic lacks gain`,
/// `statistic.mean of gain = 1 (must be 25.5)`.
///
/// @param kind   Of the database.
/// @param write  Writes to a new file in memory what is expected. The same functions as those that
///               write to a campaign database: nothing is said twice of what a table holds.
std::vector<std::string> table_differences(const Database& database, const detail::StoredKind& kind,
                                           std::span<const ComparedTable> tables,
                                           const std::function<void(Database&)>& write) {
  Database expected("new campaign", detail::Access::memory);
  detail::Transaction transaction(expected);
  detail::migrate(expected, *kind.model, kind.results);
  write(expected);
  std::vector<std::string> differences;
  for (const ComparedTable& table : tables) compare(database, expected, table, differences);
  return differences;
}

}  // namespace

void Store::write_statistics(const CampaignStatistics& statistics,
                             const std::optional<ErrorBudget>& budget, const ResultDigests& digests,
                             std::span<const RunWarning> warnings) {
  impl_->commit([&](Database& database) {
    replace_all(database, schema(), statistics, budget, warnings);
    detail::replace_summary(database, statistics,
                            database.count("SELECT count(*) FROM run_failure"), digests);
  });
}

std::optional<Summary> Store::summary() const {
  Statement select = impl_->database.prepare(
      "SELECT num_finished,"
      " num_estimated + num_not_converged + num_not_finite + num_no_draw + num_lost AS num_counted,"
      " num_given_up, digest, health_digest FROM summary");
  if (!select.step()) return std::nullopt;
  return Summary{.num_finished = select.count(0),
                 .num_counted = select.count(1),
                 .num_given_up = select.count(2),
                 .digests = {.results = select.text(3), .health = select.text(4)}};
}

std::vector<std::string> Store::parameter_differences(const Campaign& campaign) const {
  constexpr std::array tables{
      ComparedTable{.name = "parameter", .row_name = "parameter"},
      ComparedTable{.name = "budget_coefficient", .row_name = "parameter || ' in ' || term"}};
  return table_differences(
      impl_->database, impl_->kind,
      std::span(tables).first(has_own_budget(impl_->database) ? 2 : 1),
      [&](Database& expected) { detail::insert_parameters(expected, campaign); });
}

std::vector<std::string> Store::statistic_differences(const CampaignStatistics& statistics,
                                                      const std::optional<ErrorBudget>& budget,
                                                      std::span<const RunWarning> warnings,
                                                      const std::optional<Summary>& summary) const {
  constexpr std::array tables{
      ComparedTable{.name = "summary",
                    .row_name = "''",
                    .columns =
                        "num_estimated, num_not_converged, num_not_finite, num_no_draw, num_lost,"
                        " num_within_objectives, within_objectives_lower, within_objectives_upper",
                    .tolerance = rounding},
      ComparedTable{.name = "statistic", .row_name = "parameter", .tolerance = rounding},
      ComparedTable{.name = "budget_entry", .row_name = "term", .tolerance = rounding},
      ComparedTable{.name = "run_warning",
                    .row_name = "effect || ' on ' || parameter || ' in run ' || run_index",
                    .tolerance = rounding}};
  const bool has_same_rules =
      has_own_budget(impl_->database) && model_version() == model().version();
  return table_differences(
      impl_->database, impl_->kind, std::span(tables).first(has_same_rules ? 4 : 2),
      [&](Database& expected) {
        replace_all(expected, schema(), statistics, budget, warnings);
        if (!summary) return;
        detail::replace_summary(expected, statistics, summary->num_given_up, summary->digests);
      });
}

std::vector<std::string> Store::stop_check_differences(
    std::span<const StopCheckRow> expected) const {
  constexpr std::array tables{
      ComparedTable{.name = "stop_check",
                    .row_name = "statistic || ' after ' || num_runs || ' runs'",
                    .columns = "estimate, lower, upper, relative_half_width, is_reached",
                    .tolerance = rounding,
                    .may_have_further_rows = true}};
  return table_differences(impl_->database, impl_->kind, tables, [&](Database& database) {
    for (const StopCheckRow& row : expected) {
      detail::replace_stop_check(database, row.num_runs, row.statistic, row.check);
    }
  });
}

void Store::record_stop_check(std::uint64_t num_runs, std::string_view statistic,
                              const StopCheck& check) {
  impl_->commit([&](Database& database) {
    detail::replace_stop_check(database, num_runs, statistic, check);
  });
}

std::vector<StopCheckRow> Store::stop_checks() const {
  const auto check = [](const Statement& row) {
    return StopCheckRow{.statistic = row.text(0),
                        .num_runs = row.count(1),
                        .check = {.is_reached = row.integer(2) != 0,
                                  .estimate = row.real(3),
                                  .interval = row.interval(4),
                                  .relative_half_width = row.optional_real(6)}};
  };
  return rows_of(
      impl_->database,
      "SELECT statistic, num_runs, is_reached, estimate, lower, upper, relative_half_width "
      "FROM stop_check ORDER BY statistic, num_runs",
      check);
}

bool Store::has_statistics() const {
  return impl_->database.integer("SELECT EXISTS (SELECT 1 FROM statistic)") != 0;
}

}  // namespace proofmass::coordinator
