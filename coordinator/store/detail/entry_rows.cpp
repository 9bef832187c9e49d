#include <fmt/format.h>

#include <chrono>
#include <ctime>
#include <limits>
#include <utility>
#include <variant>

#include "coordinator/store/detail/rows.hpp"
#include "coordinator/store/records.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator::detail {
namespace {

using wire::Field;

constexpr std::uint64_t event_text_size_max = 2000;
constexpr std::int64_t num_events_max = 10'000;

// What differed once stays, whatever the worker says of the run later.
constexpr std::string_view insert_audit_sql =
    "INSERT INTO audit VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT DO UPDATE SET"
    " is_equal = excluded.is_equal, second_digest = excluded.second_digest,"
    " compared_unix_s = excluded.compared_unix_s WHERE is_equal";

// The rows of `attempt` that were blamed on run ?1; the columns are as in the index.
constexpr std::string_view insert_failure_sql =
    "WITH blamed AS (SELECT attempt_id, reason FROM attempt"
    " WHERE is_blamed AND first_run <= ?1 AND first_run + num_runs > ?1) "
    "INSERT INTO run_failure (run_index, reason, num_attempts)"
    " SELECT ?1, coalesce((SELECT reason FROM blamed ORDER BY attempt_id DESC LIMIT 1), 'crashed'),"
    " (SELECT count(*) FROM blamed)"
    " WHERE NOT EXISTS (SELECT 1 FROM run_result WHERE run_index = ?1) ON CONFLICT DO NOTHING";

// What a peer says of itself is any 64 bits; no process has such a number.
std::int64_t storable(std::uint64_t value) {
  constexpr auto max = std::numeric_limits<std::int64_t>::max();
  return value > static_cast<std::uint64_t>(max) ? max : static_cast<std::int64_t>(value);
}

}  // namespace

std::string hexadecimal(std::uint64_t value) { return fmt::format("{:016x}", value); }

WorkerRows::WorkerRows(const Database& database)
    : database_(database),
      select_key_(database.prepare("SELECT worker_key FROM worker WHERE session = ?")) {}

void WorkerRows::write(const WorkerJoined& joined) {
  if (is_full() && !stored_key(joined.session)) {
    (void)key_of_further();
    return;
  }
  database_
      .prepare(
          "INSERT INTO worker (session, worker, host, process_id, num_slots, cards)"
          " VALUES (?, ?, ?, ?, ?, ?) "
          "ON CONFLICT (session) DO UPDATE SET worker = excluded.worker, host = excluded.host,"
          " process_id = excluded.process_id, num_slots = excluded.num_slots,"
          " cards = excluded.cards, ended_utc = NULL, end_reason = NULL")
      .run(hexadecimal(joined.session.value), joined.name, joined.host, storable(joined.process_id),
           joined.num_slots, joined.cards);
}

void WorkerRows::write(const WorkerEnded& ended) {
  database_
      .prepare(
          "UPDATE worker SET end_reason = ?, ended_utc = strftime('%Y-%m-%dT%H:%M:%SZ', 'now') "
          "WHERE session = ?")
      .run(wire::name_of(ended.reason), hexadecimal(ended.session.value));
}

std::optional<std::int64_t> WorkerRows::stored_key(wire::SessionId session) {
  select_key_.bind_all(hexadecimal(session.value));
  if (!select_key_.step()) return std::nullopt;
  const std::int64_t key = select_key_.integer(0);
  select_key_.finish();
  return key;
}

bool WorkerRows::is_full() const {
  return database_.integer("SELECT ifnull(max(worker_key), 0) FROM worker") >= num_workers_max;
}

std::int64_t WorkerRows::key_of_further() {
  const std::string_view select =
      "SELECT ifnull((SELECT worker_key FROM worker WHERE worker_key > ? AND session IS NULL"
      " AND worker = 'further workers' LIMIT 1), 0)";
  Statement row = database_.prepare(select);
  row.bind_all(num_workers_max - 1);
  if (row.step() && row.integer(0) != 0) return row.integer(0);
  row.finish();
  has_overflowed_ = true;
  database_.prepare("INSERT INTO worker (session, worker, host) VALUES (NULL, ?, '')")
      .run(std::string_view("further workers"));
  return database_.last_row();
}

std::int64_t WorkerRows::key_of(wire::SessionId session) {
  const auto found = keys_.find(session);
  if (found != keys_.end()) return found->second;
  std::optional<std::int64_t> key = stored_key(session);
  if (!key && is_full()) key = key_of_further();
  if (!key) {
    database_.prepare("INSERT INTO worker (session, worker, host) VALUES (?, '', '')")
        .run(hexadecimal(session.value));
    key = database_.last_row();
  }
  if (keys_.size() >= static_cast<std::size_t>(num_workers_max)) keys_.clear();
  keys_.emplace(session, *key);
  return *key;
}

std::string WorkerRows::name_of(wire::SessionId session) {
  Statement select = database_.prepare("SELECT worker FROM worker WHERE worker_key = ?");
  select.bind_all(key_of(session));
  if (!select.step()) database_.refuse_as_damaged("worker lacks a row that is referred to");
  return select.text(0);
}

void WorkerRows::count_result(std::int64_t worker, double compute_s) {
  Count& count = counts_[worker];
  ++count.num_results;
  count.compute_s += compute_s;
}

void WorkerRows::write_counts(std::int64_t now_unix_s) {
  Statement update = database_.prepare(
      "UPDATE worker SET num_results = num_results + ?, compute_s = min(compute_s + ?, 1e15),"
      " last_result_unix_s = max(ifnull(last_result_unix_s, ?3), ?3) WHERE worker_key = ?4");
  for (const auto& [worker, count] : counts_) {
    update.run(count.num_results, count.compute_s, now_unix_s, worker);
  }
  counts_.clear();
}

EntryRows::EntryRows(const Database& database, const ResultSchema& results)
    : database_(database),
      results_(database, results),
      largest_errors_(database, results),
      workers_(database),
      insert_delivery_(database.prepare("INSERT INTO delivery VALUES (?, ?, ?, ?, ?)")),
      insert_audit_(database.prepare(insert_audit_sql)),
      insert_attempt_(database.prepare(
          "INSERT INTO attempt (first_run, num_runs, attempt, worker_key, reason, is_blamed,"
          " lost_unix_s) VALUES (?, ?, ?, ?, ?, ?, ?)")),
      trim_attempts_(
          database.prepare("DELETE FROM attempt WHERE attempt_id <= last_insert_rowid() - ?")),
      insert_event_(database.prepare(
          "INSERT INTO event (time_utc, kind, text)"
          " VALUES (strftime('%Y-%m-%dT%H:%M:%fZ', ?, 'unixepoch'), ?, substr(?, 1, ?))")),
      trim_events_(
          database.prepare("DELETE FROM event WHERE event_id <= last_insert_rowid() - ?")) {}

std::vector<Comparison> EntryRows::write(std::span<const Entry> entries) {
  now_unix_s_ = static_cast<std::int64_t>(std::time(nullptr));
  has_failures_ = database_.integer("SELECT EXISTS (SELECT 1 FROM run_failure)") != 0;
  for (const Entry& entry : entries) {
    std::visit([this](const auto& kind) { write_entry(kind); }, entry);
  }
  workers_.write_counts(now_unix_s_);
  if (workers_.take_overflow()) {
    write_entry(entry_of(wire::Event::info("worker_table_full",
                                           {{"rows", std::uint64_t{num_workers_max}},
                                            Field::remark("(further workers share one row)")})));
  }
  return std::exchange(comparisons_, {});
}

void EntryRows::write_entry(const Delivery& delivery) {
  if (!results_.insert(delivery.result)) {
    require_delivery(delivery.result.run);
    compare(delivery);
    return;
  }
  const std::int64_t worker = workers_.key_of(delivery.worker);
  insert_delivery_.run(delivery.result.run.value, worker, delivery.attempt.value,
                       delivery.compute_s, now_unix_s_);
  if (has_failures_) {
    database_.prepare("DELETE FROM run_failure WHERE run_index = ?").run(delivery.result.run.value);
  }
  largest_errors_.add(delivery.result);
  workers_.count_result(worker, delivery.compute_s);
}

void EntryRows::write_entry(const SecondDelivery& second) { compare(second.delivery); }

// A run without a delivery would be lent again each time that the campaign is resumed.
void EntryRows::require_delivery(RunIndex run) const {
  Statement select = database_.prepare("SELECT 1 FROM delivery WHERE run_index = ?");
  select.bind_all(run.value);
  if (select.step()) return;
  database_.refuse_as_damaged(fmt::format("delivery lacks run {}, which has a result", run.value));
}

void EntryRows::compare(const Delivery& delivery) {
  const RunIndex run = delivery.result.run;
  const RunResult stored = results_.read(run);
  const bool is_equal = are_equal(delivery.result, stored);
  const std::int64_t worker = workers_.key_of(delivery.worker);
  if (has_room_for_audit(run, worker, is_equal)) {
    insert_audit_.run(run.value, worker, std::int64_t{is_equal}, hexadecimal(digest(stored)),
                      hexadecimal(digest(delivery.result)), now_unix_s_);
  }
  comparisons_.push_back({.run = run, .worker = delivery.worker, .is_equal = is_equal});
  if (is_equal) return;
  write_entry(entry_of(
      wire::Event::info("contradicting_result", {{"run", run.value},
                                                 {"worker", workers_.name_of(delivery.worker)},
                                                 {"session", hexadecimal(delivery.worker.value)},
                                                 {"attempt", delivery.attempt.value}})));
}

bool EntryRows::has_room_for_audit(RunIndex run, std::int64_t worker, bool is_equal) {
  Statement select =
      database_.prepare("SELECT 1 FROM audit WHERE run_index = ? AND worker_key = ?");
  select.bind_all(run.value, worker);
  if (select.step()) return true;  // The row is there.
  if (!num_audits_) num_audits_ = database_.count("SELECT count(*) FROM audit");
  const std::uint64_t num_equal_max =
      database_.count("SELECT num_runs FROM campaign") + num_further_audits_max;
  const std::uint64_t num_max = is_equal ? num_equal_max : num_equal_max + num_further_audits_max;
  if (*num_audits_ < num_max) {
    ++*num_audits_;
    return true;
  }
  if (!std::exchange(is_audit_full_, true)) {
    write_entry(entry_of(
        wire::Event::info("audit_history_full",
                          {{"rows", *num_audits_},
                           Field::remark("(further second results are compared and not kept)")})));
  }
  return false;
}

void EntryRows::write_entry(const ReturnedRuns& lost) {
  insert_attempt_.run(lost.runs.first.value, lost.runs.count, lost.attempt.value,
                      workers_.key_of(lost.worker), wire::name_of(lost.reason),
                      std::int64_t{lost.is_blamed}, now_unix_s_);
  trim_attempts_.run(num_attempts_max);
  if (database_.last_row() != num_attempts_max + 1) return;
  write_entry(entry_of(wire::Event::info(
      "attempt_history_full",
      {{"rows", std::uint64_t{num_attempts_max}}, Field::remark("(older ones are dropped)")})));
}

void EntryRows::write_entry(const GivenUpRun& given_up) {
  database_.prepare(insert_failure_sql).run(given_up.run.value);
  has_failures_ = true;
}

void EntryRows::write_entry(const RetriedRuns&) {
  database_.prepare("DELETE FROM run_failure").run();
  has_failures_ = false;
}

void EntryRows::write_entry(const EventEntry& event) {
  // In whole milliseconds, as in the log.
  const auto time_ms =
      std::chrono::floor<std::chrono::milliseconds>(event.time.time_since_epoch()).count();
  insert_event_.run(static_cast<double>(time_ms) / 1000.0, event.kind, event.text,
                    event_text_size_max);
  trim_events_.run(num_events_max);
}

void EntryRows::write_entry(const CampaignControl& control) { write_control(database_, control); }

}  // namespace proofmass::coordinator::detail
