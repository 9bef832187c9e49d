#include "coordinator/store/detail/control_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>

#include "coordinator/store/detail/entry_rows.hpp"
#include "coordinator/store/detail/integrity.hpp"
#include "coordinator/store/store_error.hpp"

namespace proofmass::coordinator::detail {
namespace {

// By the value of CampaignPhase, from 1.
constexpr std::array<std::string_view, 4> phase_names{"active", "paused", "finished", "cancelled"};

std::string_view name_of(wire::CampaignPhase phase) {
  return phase_names.at(static_cast<std::size_t>(phase) - 1);
}

// The schema allows no other names, but a file from elsewhere may have another one.
wire::CampaignPhase read_phase(const Database& database, std::string_view name) {
  const auto found = std::find(phase_names.begin(), phase_names.end(), name);
  if (found == phase_names.end()) database.refuse_as_damaged(fmt::format("phase = {}", name));
  return static_cast<wire::CampaignPhase>(found - phase_names.begin() + 1);
}

/// Whether a row of a table whose primary key is run_index has the run.
class RunLookup {
 public:
  RunLookup(const Database& database, std::string_view table)
      : select_(database.prepare(fmt::format("SELECT 1 FROM {} WHERE run_index = ?", table))) {}

  [[nodiscard]] bool contains(std::uint64_t run) {
    select_.bind_all(run);
    const bool is_there = select_.step();
    if (is_there) select_.finish();
    return is_there;
  }

 private:
  Statement select_;
};

// Ranges that overlap, or runs that the campaign does not have, would be counted by everybody else.
void check_next_run(const Statement& row, std::span<const RunRange> ranges,
                    std::uint64_t num_runs) {
  const std::uint64_t run = row.count(0);
  if (!ranges.empty() && run < ranges.back().end()) {
    row.refuse_as_damaged(fmt::format("run {} comes after run {}", run, ranges.back().end() - 1));
  }
  if (run < num_runs) return;
  row.refuse_as_damaged(fmt::format("row of run {}, of {} there are", run, num_runs));
}

}  // namespace

CampaignControl read_control(const Database& database) {
  Statement select = database.prepare("SELECT phase, priority, audit_fraction FROM campaign");
  if (!select.step()) database.refuse_as_damaged("it has no campaign");
  const std::int64_t priority = select.integer(1);
  const double audit_fraction = select.real(2);
  if (priority < std::numeric_limits<int>::min() || priority > std::numeric_limits<int>::max()) {
    database.refuse_as_damaged(fmt::format("priority = {}", priority));
  }
  if (!(audit_fraction >= 0.0 && audit_fraction <= 1.0)) {
    database.refuse_as_damaged(fmt::format("audit_fraction = {}", audit_fraction));
  }
  return {.phase = read_phase(database, select.text(0)),
          .priority = static_cast<int>(priority),
          .audit_fraction = audit_fraction};
}

void write_control(const Database& database, const CampaignControl& control) {
  database.prepare("UPDATE campaign SET phase = ?, priority = ?, audit_fraction = ?")
      .run(name_of(control.phase), std::int64_t{control.priority}, control.audit_fraction);
}

StopPlan read_stop_plan(const Database& database) {
  Statement select = database.prepare("SELECT stop_rule, num_runs_max, failures_max FROM campaign");
  if (!select.step()) database.refuse_as_damaged("it has no campaign");
  return {.stop_rule = select.text(0),
          .num_runs_max = select.optional_count(1),
          .failures_max = select.optional_count(2)};
}

std::optional<std::uint64_t> read_num_runs_fixed(const Database& database) {
  Statement select = database.prepare("SELECT num_runs_fixed FROM campaign");
  if (!select.step()) database.refuse_as_damaged("it has no campaign");
  return select.optional_count(0);
}

void fix_num_runs(const Database& database) {
  database
      .prepare(
          "UPDATE campaign SET num_runs_fixed = iif(stop_rule = '', num_runs, NULL)"
          " WHERE NOT EXISTS (SELECT 1 FROM delivery)")
      .run();
}

void write_stop_plan(const Database& database, const StopPlan& plan) {
  database
      .prepare(
          "UPDATE campaign SET stop_rule = ?1, num_runs_max = ?2, failures_max = ?3,"
          " phase = iif(phase = 'finished' AND ?1 <> ''"
          " AND (stop_rule, num_runs_max, failures_max) IS NOT (?1, ?2, ?3), 'active', phase)")
      .run(plan.stop_rule, plan.num_runs_max, plan.failures_max);
  fix_num_runs(database);
  write_table_digest(database);
}

std::optional<StoredStopCheck> read_last_stop_check(const Database& database,
                                                    std::string_view statistic) {
  Statement select = database.prepare(
      "SELECT num_runs, is_reached, relative_half_width, estimate, lower, upper FROM stop_check "
      "WHERE statistic = ? "
      "ORDER BY num_runs DESC LIMIT 1");
  select.bind(1, statistic);
  if (!select.step()) return std::nullopt;
  StoredStopCheck check{.num_runs = select.count(0),
                        .is_reached = select.integer(1) != 0,
                        .relative_half_width = select.optional_real(2),
                        .estimate = select.real(3),
                        .interval = {}};
  const std::optional<double> lower = select.optional_real(4);
  const std::optional<double> upper = select.optional_real(5);
  if (lower && upper) check.interval = Interval{.lower = *lower, .upper = *upper};
  return check;
}

std::vector<StopCheckRow> read_stop_checks(const Database& database) {
  Statement select = database.prepare(
      "SELECT statistic, num_runs, is_reached, estimate, lower, upper, relative_half_width "
      "FROM stop_check ORDER BY statistic, num_runs");
  std::vector<StopCheckRow> rows;
  while (select.step()) {
    StopCheckRow& row = rows.emplace_back(
        StopCheckRow{.statistic = select.text(0), .num_runs = select.count(1), .check = {}});
    row.check.is_reached = select.integer(2) != 0;
    row.check.estimate = select.real(3);
    const std::optional<double> lower = select.optional_real(4);
    const std::optional<double> upper = select.optional_real(5);
    if (lower && upper) row.check.interval = Interval{.lower = *lower, .upper = *upper};
    row.check.relative_half_width = select.optional_real(6);
  }
  return rows;
}

void replace_stop_check(const Database& database, std::uint64_t num_runs,
                        std::string_view statistic, const StopCheck& check) {
  const bool is_bounded = check.interval.has_value();
  database
      .prepare(
          "INSERT OR REPLACE INTO stop_check (statistic, num_runs, estimate, lower, upper,"
          " relative_half_width, is_reached) VALUES (?, ?, ?, ?, ?, ?, ?)")
      .run(statistic, num_runs, check.estimate,
           is_bounded ? std::optional(check.interval->lower) : std::nullopt,
           is_bounded ? std::optional(check.interval->upper) : std::nullopt,
           check.relative_half_width, std::int64_t{check.is_reached});
}

std::vector<RunRange> read_runs(const Database& database, std::string_view sql) {
  Statement select = database.prepare(sql);
  std::vector<RunRange> ranges;
  if (!select.step()) return ranges;
  // Of the same state of the file as the rows, as the query is under way.
  const std::uint64_t num_runs = database.count("SELECT num_runs FROM campaign");
  do {
    check_next_run(select, ranges, num_runs);
    append(ranges, RunIndex{select.count(0)});
  } while (select.step());
  return ranges;
}

std::vector<BlamedRun> read_blamed_runs(const Database& database) {
  RunLookup results(database, "run_result");
  RunLookup failures(database, "run_failure");
  const std::uint64_t num_runs = database.count("SELECT num_runs FROM campaign");
  Statement select =
      database.prepare("SELECT first_run, num_runs, attempt FROM attempt WHERE is_blamed");
  std::map<RunIndex, BlamedRun> blamed;
  while (select.step()) {
    const std::uint64_t first = select.count(0);
    const std::uint64_t end = first + select.count(1);
    if (end > num_runs) {
      database.refuse_as_damaged(
          fmt::format("attempt at runs {} to {}, of {} there are", first, end - 1, num_runs));
    }
    for (std::uint64_t run = first; run < end; ++run) {
      if (results.contains(run) || failures.contains(run)) continue;
      BlamedRun& entry = blamed[RunIndex{run}];
      entry.run = RunIndex{run};
      ++entry.num_crashes;
      entry.attempt =
          std::max(entry.attempt, wire::Attempt{static_cast<std::uint32_t>(select.count(2))});
    }
  }
  std::vector<BlamedRun> runs;
  for (const auto& [run, entry] : blamed) runs.push_back(entry);
  return runs;
}

std::vector<Contradiction> read_contradictions(const Database& database) {
  Statement select = database.prepare(
      "SELECT a.run_index, w.worker, a.stored_digest, a.second_digest "
      "FROM audit AS a JOIN worker AS w USING (worker_key) "
      "WHERE NOT a.is_equal ORDER BY a.run_index, a.worker_key");
  std::vector<Contradiction> contradictions;
  while (select.step()) {
    contradictions.push_back({.run = RunIndex{select.count(0)},
                              .worker = select.text(1),
                              .stored_digest = select.text(2),
                              .second_digest = select.text(3)});
  }
  return contradictions;
}

void insert_start(const Database& database, const CoordinatorStart& start) {
  database
      .prepare(
          "INSERT INTO coordinator_start (epoch, host, process_id, version) VALUES (?, ?, ?, ?) "
          "ON CONFLICT (epoch) DO UPDATE SET ended_utc = NULL")
      .run(hexadecimal(start.epoch.value), start.host, start.process_id, start.version);
}

void end_start(const Database& database, wire::Epoch epoch) {
  database
      .prepare(
          "UPDATE coordinator_start SET ended_utc = strftime('%Y-%m-%dT%H:%M:%fZ', 'now') "
          "WHERE epoch = ?")
      .run(hexadecimal(epoch.value));
}

}  // namespace proofmass::coordinator::detail
