// What a Store keeps for the next coordinator: how the campaign is served and until when, which of
// its runs are done, and who computed them; and what it tells of them afterwards.

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <span>

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
  select.bind_all(num_runs);
  if (!select.step()) return;
  database.refuse_as_damaged(fmt::format("attempt at runs {} to {}, of {} there are",
                                         select.count(0), select.count(0) + select.count(1) - 1,
                                         num_runs));
}

/// Reasons are words of this program; a file from elsewhere may have any number of others.
/// @param keys  Columns of which each combination is counted by itself.
std::vector<LossCount> losses_by(const Database& database, std::string_view keys) {
  return detail::structs_of<LossCount, 4>(
      database, fmt::format("SELECT reason, count(*), sum(num_runs), sum(is_blamed) FROM attempt "
                            "GROUP BY {0} ORDER BY 3 DESC, {0} LIMIT 20",
                            keys));
}

}  // namespace

CampaignControl Store::control() const { return detail::read_control(impl_->database); }

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
  return detail::structs_of<BlamedRun, 3>(
      impl_->database,
      "WITH RECURSIVE blamed (run, last, attempt) AS ("
      " SELECT first_run, first_run + num_runs - 1, attempt FROM attempt"
      " WHERE is_blamed AND num_runs > 0"
      " UNION ALL SELECT run + 1, last, attempt FROM blamed WHERE run < last) "
      "SELECT run, count(*), max(attempt) FROM blamed"
      " WHERE NOT EXISTS (SELECT 1 FROM run_result WHERE run_index = blamed.run)"
      " AND NOT EXISTS (SELECT 1 FROM run_failure WHERE run_index = blamed.run)"
      " GROUP BY run ORDER BY run");
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
  return detail::structs_of<Contradiction, 4>(
      impl_->database,
      "SELECT a.run_index, w.worker, a.stored_digest, a.second_digest "
      "FROM audit AS a JOIN worker AS w USING (worker_key) "
      "WHERE NOT a.is_equal ORDER BY a.run_index, a.worker_key");
}

std::vector<wire::SessionId> Store::attached_sessions() const {
  return rows_of(impl_->database,
                 "SELECT session FROM worker WHERE session IS NOT NULL AND ended_utc IS NULL"
                 " ORDER BY session",
                 [this](const Statement& row) -> wire::SessionId {
                   return {detail::number_in(impl_->database, "worker.session", row.text(0), 16)};
                 });
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
  std::vector<StoredEvent> events = detail::structs_of<StoredEvent, 4>(
      impl_->database,
      "SELECT event_id, time_utc, kind, text FROM event WHERE event_id > ? "
      "ORDER BY event_id DESC LIMIT ?",
      id, std::uint64_t{count_max});
  std::ranges::reverse(events);
  return events;
}

std::vector<LossCount> Store::losses() const { return losses_by(impl_->database, "reason"); }

// The condition of the inner query is that of an index: completed runs are not looked at.
std::vector<EndCount> Store::ends_without_estimate() const {
  return detail::structs_of<EndCount, 4>(
      impl_->database,
      "SELECT CASE status WHEN 2 THEN 'not converged' WHEN 3 THEN 'not finite'"
      " WHEN 4 THEN 'no draw' ELSE 'lost' END, cause, session, count(*) FROM "
      "(SELECT r.status, ifnull(h.loss_cause, '') AS cause, ifnull(h.loss_session, '') AS session "
      " FROM run_result AS r LEFT JOIN loop_health AS h USING (run_index) "
      " WHERE r.status <> 1) "
      "GROUP BY status, cause, session ORDER BY 4 DESC, status, cause, session");
}

std::vector<GivenUpRecord> Store::given_up_records(std::size_t count_max) const {
  return detail::structs_of<GivenUpRecord, 4>(
      impl_->database,
      "SELECT run_index, reason, num_attempts, given_up_utc FROM run_failure "
      "ORDER BY run_index LIMIT ?",
      std::uint64_t{count_max});
}

// Runs of one batch have the same share of its time, to the bit, and come in one message.
RecentAttempts Store::recent_attempts(std::size_t num_runs_max, std::size_t num_losses_max) const {
  const detail::ReadTransaction one_state(impl_->database);
  const std::uint64_t num_runs = impl_->database.count("SELECT count(*) FROM delivery");
  return {.computed = detail::structs_of<RecentAttempt, 8>(
              impl_->database,
              "SELECT worker_key, worker, count(*), min(run_index), max(run_index), attempt,"
              " d.compute_s * count(*), received_unix_s FROM "
              "(SELECT * FROM delivery ORDER BY received_unix_s DESC, run_index LIMIT ?) AS d "
              "JOIN worker USING (worker_key) "
              "GROUP BY received_unix_s, worker_key, d.compute_s, attempt "
              "ORDER BY received_unix_s DESC, worker_key, d.compute_s, attempt",
              std::uint64_t{num_runs_max}),
          .lost = detail::structs_of<RecentAttempt, 9>(
              impl_->database,
              "SELECT worker_key, worker, num_runs, first_run, first_run + num_runs - 1, attempt,"
              " 0.0, lost_unix_s, reason FROM attempt JOIN worker USING (worker_key) "
              "ORDER BY attempt_id DESC LIMIT ?",
              std::uint64_t{num_losses_max}),
          .num_runs_left_out = num_runs - std::min<std::uint64_t>(num_runs, num_runs_max)};
}

CampaignExecution Store::execution() const {
  CampaignExecution execution =
      detail::structs_of<CampaignExecution, 8>(
          impl_->database,
          "SELECT (SELECT count(*) FROM coordinator_start), count(*), count(DISTINCT host),"
          " total(compute_s), (SELECT count(*) FROM delivery WHERE attempt > 1),"
          " (SELECT count(*) FROM audit), first, last FROM worker,"
          " (SELECT strftime('%Y-%m-%dT%H:%M:%SZ', min(received_unix_s), 'unixepoch') AS first,"
          "  strftime('%Y-%m-%dT%H:%M:%SZ', max(received_unix_s), 'unixepoch') AS last"
          "  FROM delivery)")
          .front();
  execution.hosts = detail::structs_of<HostShare, 6>(
      impl_->database,
      "SELECT host, count(*), sum(num_results), sum(compute_s),"
      " ifnull(max(last_result_unix_s) - min(unixepoch(first_seen_utc)), 0),"
      " ifnull(group_concat(DISTINCT nullif(cards, '')), '') "
      "FROM worker GROUP BY host ORDER BY sum(num_results) DESC, host LIMIT 20");
  execution.losses = losses_by(impl_->database, "reason, is_blamed");
  return execution;
}

}  // namespace proofmass::coordinator
