// What a Store keeps for the next coordinator: how the campaign is served and until when, which of
// its runs are done, and who computed them.

#include <fmt/format.h>

#include <charconv>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <system_error>

#include "coordinator/store/detail/campaign_rows.hpp"
#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/entry_rows.hpp"
#include "coordinator/store/detail/integrity.hpp"
#include "coordinator/store/detail/store_impl.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {

using detail::Database;
using detail::Statement;

namespace {

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

/// The runs in the first column of a query, which are ascending; neighbours are one range.
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

// A file from elsewhere may have an attempt at so many runs that nobody could go through them.
void check_blamed_attempts(const Database& database) {
  const std::uint64_t num_runs = database.count("SELECT num_runs FROM campaign");
  Statement select = database.prepare(
      "SELECT first_run, num_runs FROM attempt"
      " WHERE is_blamed AND (first_run + num_runs > ? OR first_run < 0 OR num_runs < 0)");
  select.bind(1, num_runs);
  if (!select.step()) return;
  database.refuse_as_damaged(fmt::format("attempt at runs {} to {}, of {} there are",
                                         select.count(0), select.count(0) + select.count(1) - 1,
                                         num_runs));
}

wire::SessionId session_of(const std::string& digits) {
  wire::SessionId session;
  const char* const end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, session.value, 16);
  if (error == std::errc() && stop == end) return session;
  throw StoreError(fmt::format("worker.session = {} (must be hexadecimal)", digits));
}

}  // namespace

CampaignControl Store::control() const { return detail::read_control(impl_->database); }

StopPlan Store::stop_plan() const {
  const Statement select =
      impl_->database.first_row("SELECT stop_rule, num_runs_max, failures_max FROM campaign");
  return {.stop_rule = select.text(0),
          .num_runs_max = select.optional_count(1),
          .failures_max = select.optional_count(2)};
}

void Store::set_stop_plan(const StopPlan& plan) {
  impl_->commit([&](Database& database) {
    database
        .prepare(
            "UPDATE campaign SET stop_rule = ?1, num_runs_max = ?2, failures_max = ?3,"
            " phase = iif(phase = 'finished' AND ?1 <> ''"
            " AND (stop_rule, num_runs_max, failures_max) IS NOT (?1, ?2, ?3), 'active', phase)")
        .run(plan.stop_rule, plan.num_runs_max, plan.failures_max);
    detail::fix_num_runs(database);
    detail::write_table_digest(database, model());
  });
}

std::optional<std::uint64_t> Store::num_runs_fixed() const {
  return detail::read_num_runs_fixed(impl_->database);
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

std::uint64_t Store::num_without_estimate() const {
  return impl_->database.count("SELECT count(*) FROM run_result WHERE status <> 1");
}

std::vector<RunRange> Store::finished_runs() const {
  return read_runs(impl_->database, "SELECT run_index FROM delivery ORDER BY 1");
}

std::vector<RunRange> Store::compared_runs() const {
  return read_runs(impl_->database, "SELECT DISTINCT run_index FROM audit ORDER BY 1");
}

std::vector<RunRange> Store::given_up_runs() const {
  if (impl_->database.integer("SELECT EXISTS (SELECT 1 FROM run_failure"
                              " WHERE run_index IN (SELECT run_index FROM delivery))") != 0) {
    impl_->database.refuse_as_damaged("a run is given up and has a result");
  }
  return read_runs(impl_->database, "SELECT run_index FROM run_failure ORDER BY 1");
}

std::vector<BlamedRun> Store::blamed_runs() const {
  const detail::ReadTransaction one_state(impl_->database);
  check_blamed_attempts(impl_->database);
  const auto blamed = [](const Statement& row) {
    return BlamedRun{.run = RunIndex{row.count(0)},
                     .num_crashes = static_cast<std::uint32_t>(row.count(1)),
                     .attempt = {static_cast<std::uint32_t>(row.count(2))}};
  };
  return rows_of(impl_->database,
                 "WITH RECURSIVE blamed (run, last, attempt) AS ("
                 " SELECT first_run, first_run + num_runs - 1, attempt FROM attempt"
                 " WHERE is_blamed AND num_runs > 0"
                 " UNION ALL SELECT run + 1, last, attempt FROM blamed WHERE run < last) "
                 "SELECT run, count(*), max(attempt) FROM blamed"
                 " WHERE NOT EXISTS (SELECT 1 FROM run_result WHERE run_index = blamed.run)"
                 " AND NOT EXISTS (SELECT 1 FROM run_failure WHERE run_index = blamed.run)"
                 " GROUP BY run ORDER BY run",
                 blamed);
}

std::uint64_t Store::num_before_blame() const {
  return impl_->database.count(
      "SELECT coalesce((SELECT min(first_run) FROM attempt WHERE is_blamed), num_runs)"
      " FROM campaign");
}

std::uint64_t Store::num_compared() const {
  return impl_->database.count("SELECT count(*) FROM audit");
}

std::vector<Contradiction> Store::contradictions() const {
  const auto contradiction = [](const Statement& row) {
    return Contradiction{.run = RunIndex{row.count(0)},
                         .worker = row.text(1),
                         .stored_digest = row.text(2),
                         .second_digest = row.text(3)};
  };
  return rows_of(impl_->database,
                 "SELECT a.run_index, w.worker, a.stored_digest, a.second_digest "
                 "FROM audit AS a JOIN worker AS w USING (worker_key) "
                 "WHERE NOT a.is_equal ORDER BY a.run_index, a.worker_key",
                 contradiction);
}

std::vector<wire::SessionId> Store::attached_sessions() const {
  return rows_of(impl_->database,
                 "SELECT session FROM worker WHERE session IS NOT NULL AND ended_utc IS NULL"
                 " ORDER BY session",
                 [](const Statement& row) { return session_of(row.text(0)); });
}

void Store::begin_coordinator(const CoordinatorStart& start) {
  impl_->commit([&](Database& database) {
    database
        .prepare(
            "INSERT INTO coordinator_start (epoch, host, process_id, version) VALUES (?, ?, ?, ?) "
            "ON CONFLICT (epoch) DO UPDATE SET ended_utc = NULL")
        .run(detail::hexadecimal(start.epoch.value), start.host, start.process_id, start.version);
  });
}

void Store::end_coordinator(wire::Epoch epoch) {
  impl_->commit([&](Database& database) {
    database
        .prepare(
            "UPDATE coordinator_start SET ended_utc = strftime('%Y-%m-%dT%H:%M:%fZ', 'now') "
            "WHERE epoch = ?")
        .run(detail::hexadecimal(epoch.value));
  });
}

}  // namespace proofmass::coordinator
