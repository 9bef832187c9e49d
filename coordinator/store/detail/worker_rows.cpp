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
  database_
      .prepare(
          "INSERT INTO worker (session, name, host, process_id, num_slots) VALUES (?, ?, ?, ?, ?) "
          "ON CONFLICT (session) DO UPDATE SET name = excluded.name, host = excluded.host,"
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

std::int64_t WorkerRows::key_of(wire::SessionId session) {
  const auto found = keys_.find(session);
  if (found != keys_.end()) return found->second;
  const std::string digits = hexadecimal(session.value);
  database_
      .prepare("INSERT INTO worker (session, name, host) VALUES (?, '', '') ON CONFLICT DO NOTHING")
      .run(digits);
  select_key_.bind_all(digits);
  if (!select_key_.step()) database_.refuse_as_damaged("worker lacks session " + digits);
  const std::int64_t key = select_key_.integer(0);
  select_key_.finish();
  keys_.emplace(session, key);
  return key;
}

std::string WorkerRows::name_of(wire::SessionId session) {
  Statement select = database_.prepare("SELECT name FROM worker WHERE worker_key = ?");
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
