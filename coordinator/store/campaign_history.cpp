#include "coordinator/store/campaign_history.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <set>
#include <utility>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/store_impl.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Database;
using detail::Statement;

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
  execution.num_contradicting = database.count("SELECT count(*) FROM audit WHERE NOT is_equal");
  execution.first_result_utc = utc_of(database, "min");
  execution.last_result_utc = utc_of(database, "max");
  return execution;
}

}  // namespace proofmass::coordinator
