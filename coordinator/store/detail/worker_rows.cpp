#include "coordinator/store/detail/worker_rows.hpp"

#include <fmt/format.h>

#include <charconv>
#include <limits>
#include <system_error>

#include "coordinator/store/store_error.hpp"

namespace proofmass::coordinator::detail {
namespace {

// What a peer says of itself is any 64 bits; no process has such a number.
std::int64_t storable(std::uint64_t value) {
  constexpr auto max = std::numeric_limits<std::int64_t>::max();
  return value > static_cast<std::uint64_t>(max) ? max : static_cast<std::int64_t>(value);
}

wire::SessionId session_of(const std::string& digits) {
  wire::SessionId session;
  const char* const end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, session.value, 16);
  if (error == std::errc() && stop == end) return session;
  throw StoreError(fmt::format("worker.session = {} (must be hexadecimal)", digits));
}

}  // namespace

std::string hexadecimal(std::uint64_t value) { return fmt::format("{:016x}", value); }

std::string_view stored_name(wire::LossReason reason) {
  switch (reason) {
    case wire::LossReason::silent:
      return "silent";
    case wire::LossReason::crashed:
      return "crashed";
    case wire::LossReason::out_of_memory:
      return "out_of_memory";
    case wire::LossReason::hung:
      return "hung";
    case wire::LossReason::drained:
      return "drained";
    case wire::LossReason::walltime:
      return "walltime";
    case wire::LossReason::preempted:
      return "preempted";
    case wire::LossReason::retracted:
      return "retracted";
    case wire::LossReason::never_arrived:
      return "never_arrived";
    case wire::LossReason::protocol:
      return "protocol";
    case wire::LossReason::failed:
      return "failed";
  }
  return "unknown";
}

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
          "INSERT INTO worker (session, worker, host, process_id, num_slots) VALUES (?, ?, ?, ?, "
          "?) "
          "ON CONFLICT (session) DO UPDATE SET worker = excluded.worker, host = excluded.host,"
          " process_id = excluded.process_id, num_slots = excluded.num_slots,"
          " ended_utc = NULL, end_reason = NULL")
      .run(hexadecimal(joined.session.value), joined.name, joined.host, storable(joined.process_id),
           joined.num_slots);
}

void WorkerRows::write(const WorkerEnded& ended) {
  database_
      .prepare(
          "UPDATE worker SET end_reason = ?, ended_utc = strftime('%Y-%m-%dT%H:%M:%SZ', 'now') "
          "WHERE session = ?")
      .run(stored_name(ended.reason), hexadecimal(ended.session.value));
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

std::vector<wire::SessionId> read_attached_sessions(const Database& database) {
  Statement select = database.prepare(
      "SELECT session FROM worker WHERE session IS NOT NULL AND ended_utc IS NULL ORDER BY "
      "session");
  std::vector<wire::SessionId> sessions;
  while (select.step()) sessions.push_back(session_of(select.text(0)));
  return sessions;
}

}  // namespace proofmass::coordinator::detail
