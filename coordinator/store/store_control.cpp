// What a Store keeps for the next coordinator: how the campaign is served and until when, which of
// its runs are done, and who computed them; and what it tells of them afterwards.

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstddef>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <system_error>
#include <utility>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/rows.hpp"
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

wire::Attempt attempt_in(const Statement& row, int column) {
  return {static_cast<decltype(wire::Attempt::value)>(row.count(column))};
}

bool is_of_batch(const ComputedRuns& batch, const Statement& row) {
  return batch.worker_key == row.count(1) && batch.attempt == attempt_in(row, 2) &&
         batch.received_unix_s == row.count(4);
}

/// Runs of one batch have the same share of its time, to the bit, and come in one message.
std::vector<ComputedRuns> computed_runs(const Database& database, std::size_t num_runs_max) {
  Statement row = database.prepare(
      "SELECT run_index, worker_key, attempt, compute_s, received_unix_s FROM "
      "(SELECT * FROM delivery ORDER BY received_unix_s DESC, run_index LIMIT ?) "
      "ORDER BY received_unix_s DESC, worker_key, compute_s, attempt, run_index");
  row.bind_all(static_cast<std::uint64_t>(num_runs_max));
  std::vector<ComputedRuns> computed;
  std::uint64_t last_share_bits = 0;
  while (row.step()) {
    const double share_s = row.real(3);
    const auto share_bits = std::bit_cast<std::uint64_t>(share_s);
    const bool is_same_share = share_bits == std::exchange(last_share_bits, share_bits);
    if (computed.empty() || !is_same_share || !is_of_batch(computed.back(), row)) {
      computed.push_back({.runs = {},
                          .attempt = attempt_in(row, 2),
                          .worker_key = row.count(1),
                          .received_unix_s = row.count(4)});
    }
    computed.back().runs.push_back({row.count(0)});
    computed.back().compute_s = share_s * static_cast<double>(computed.back().runs.size());
  }
  return computed;
}

std::vector<LostAttempt> lost_attempts(const Database& database, std::size_t count_max) {
  const auto lost = [](const Statement& row) {
    return LostAttempt{.runs = {{row.count(0)}, row.count(1)},
                       .attempt = attempt_in(row, 2),
                       .worker_key = row.count(3),
                       .reason = row.text(4),
                       .lost_unix_s = row.count(5)};
  };
  return rows_of(
      database,
      "SELECT first_run, num_runs, attempt, worker_key, reason, lost_unix_s FROM attempt "
      "ORDER BY attempt_id DESC LIMIT ?",
      lost, std::uint64_t{count_max});
}

std::vector<WorkerRecord> worker_records(const Database& database, const RecentAttempts& attempts) {
  std::set<std::uint64_t> keys;
  for (const ComputedRuns& computed : attempts.computed) keys.insert(computed.worker_key);
  for (const LostAttempt& lost : attempts.lost) keys.insert(lost.worker_key);
  Statement row = database.prepare("SELECT worker, host FROM worker WHERE worker_key = ?");
  std::vector<WorkerRecord> workers;
  for (const std::uint64_t key : keys) {
    row.bind_all(key);
    if (!row.step()) continue;
    workers.push_back({.key = key, .name = row.text(0), .host = row.text(1)});
    row.finish();
  }
  return workers;
}

std::vector<HostShare> read_hosts(const Database& database) {
  const auto host = [](const Statement& row) {
    return HostShare{.host = row.text(0),
                     .num_workers = row.count(1),
                     .num_results = row.count(2),
                     .compute_s = row.real(3),
                     .serving_s = row.real(4),
                     .cards = row.text(5)};
  };
  return rows_of(database,
                 "SELECT host, count(*), sum(num_results), sum(compute_s),"
                 " ifnull(max(last_result_unix_s) - min(unixepoch(first_seen_utc)), 0),"
                 " ifnull(group_concat(DISTINCT nullif(cards, '')), '') "
                 "FROM worker GROUP BY host ORDER BY sum(num_results) DESC, host LIMIT 20",
                 host);
}

/// Reasons are words of this program; a file from elsewhere may have any number of others.
/// @param keys  Columns of which each combination is counted by itself.
std::vector<LossCount> losses_by(const Database& database, std::string_view keys) {
  const auto loss = [](const Statement& row) {
    return LossCount{.reason = row.text(0),
                     .num_losses = row.count(1),
                     .num_runs = row.count(2),
                     .num_blamed = row.count(3)};
  };
  return rows_of(database,
                 fmt::format("SELECT reason, count(*), sum(num_runs), sum(is_blamed) FROM attempt "
                             "GROUP BY {0} ORDER BY 3 DESC, {0} LIMIT 20",
                             keys),
                 loss);
}

std::optional<std::string> utc_of(const Database& database, std::string_view bound) {
  Statement row = database.prepare("SELECT strftime('%Y-%m-%dT%H:%M:%SZ', " + std::string(bound) +
                                   "(received_unix_s), 'unixepoch') FROM delivery");
  if (!row.step()) return std::nullopt;
  std::string text = row.text(0);
  if (text.empty()) return std::nullopt;
  return text;
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

std::uint64_t Store::num_contradicting() const {
  return impl_->database.count("SELECT count(*) FROM audit WHERE NOT is_equal");
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

std::vector<StoredEvent> Store::events_after(std::uint64_t id, std::size_t count_max) const {
  const auto event = [](const Statement& row) {
    return StoredEvent{
        .id = row.count(0), .time_utc = row.text(1), .kind = row.text(2), .text = row.text(3)};
  };
  std::vector<StoredEvent> events =
      rows_of(impl_->database,
              "SELECT event_id, time_utc, kind, text FROM event WHERE event_id > ? "
              "ORDER BY event_id DESC LIMIT ?",
              event, id, std::uint64_t{count_max});
  std::ranges::reverse(events);
  return events;
}

std::vector<LossCount> Store::losses() const { return losses_by(impl_->database, "reason"); }

// The condition of the inner query is that of an index: completed runs are not looked at.
std::vector<EndCount> Store::ends_without_estimate() const {
  const auto end = [](const Statement& row) {
    const std::uint64_t status = row.count(0);
    return EndCount{.status = status == 2   ? "not converged"
                              : status == 3 ? "not finite"
                              : status == 4 ? "no draw"
                                            : "lost",
                    .cause = row.text(1),
                    .session = row.text(2),
                    .num_runs = row.count(3)};
  };
  return rows_of(
      impl_->database,
      "SELECT status, cause, session, count(*) FROM "
      "(SELECT r.status, ifnull(h.loss_cause, '') AS cause, ifnull(h.loss_session, '') AS session "
      " FROM run_result AS r LEFT JOIN loop_health AS h USING (run_index) "
      " WHERE r.status <> 1) "
      "GROUP BY 1, 2, 3 ORDER BY 4 DESC, 1, 2, 3",
      end);
}

std::vector<GivenUpRecord> Store::given_up_records(std::size_t count_max) const {
  const auto run = [](const Statement& row) {
    return GivenUpRecord{.run = {row.count(0)},
                         .reason = row.text(1),
                         .num_attempts = row.count(2),
                         .given_up_utc = row.text(3)};
  };
  return rows_of(impl_->database,
                 "SELECT run_index, reason, num_attempts, given_up_utc FROM run_failure "
                 "ORDER BY run_index LIMIT ?",
                 run, std::uint64_t{count_max});
}

RecentAttempts Store::recent_attempts(std::size_t num_runs_max, std::size_t num_losses_max) const {
  const detail::ReadTransaction one_state(impl_->database);
  RecentAttempts attempts{.computed = computed_runs(impl_->database, num_runs_max),
                          .lost = lost_attempts(impl_->database, num_losses_max),
                          .workers = {}};
  attempts.workers = worker_records(impl_->database, attempts);
  const std::uint64_t num_runs = impl_->database.count("SELECT count(*) FROM delivery");
  attempts.num_runs_left_out = num_runs - std::min<std::uint64_t>(num_runs, num_runs_max);
  return attempts;
}

CampaignExecution Store::execution() const {
  const Database& database = impl_->database;
  CampaignExecution execution;
  execution.num_coordinators = database.count("SELECT count(*) FROM coordinator_start");
  execution.num_workers = database.count("SELECT count(*) FROM worker");
  execution.num_hosts = database.count("SELECT count(DISTINCT host) FROM worker");
  Statement total = database.prepare("SELECT total(compute_s) FROM worker");
  if (total.step()) execution.compute_s = total.real(0);
  execution.hosts = read_hosts(database);
  execution.losses = losses_by(database, "reason, is_blamed");
  execution.num_retried = database.count("SELECT count(*) FROM delivery WHERE attempt > 1");
  execution.num_audited = num_compared();
  execution.first_result_utc = utc_of(database, "min");
  execution.last_result_utc = utc_of(database, "max");
  return execution;
}

}  // namespace proofmass::coordinator
