#include "coordinator/dispatch/lending.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "core/error.hpp"

namespace proofmass::coordinator::detail {
namespace {

std::uint64_t num_pending(const State& state) {
  std::uint64_t count = 0;
  for (const auto& [attempt, runs] : state.pending) count += runs.size();
  return count;
}

std::uint64_t num_slots(const State& state) {
  std::uint64_t count = 0;
  for (const auto& [id, worker] : state.workers) count += worker.num_slots;
  return count;
}

/// Rounds of work that a worker's slots should hold: one that is computed and one that waits, so
/// that a batch never starts with less than it has room for; more if runs are short. But never more
/// than half of a fair share of what is left, so that all workers finish together. Before the first
/// result one, as it may be that most workers have not registered yet.
std::uint64_t rounds_wanted(const State& state, const Worker& worker) {
  const double run_time_s = worker.run_time_s > 0.0 ? worker.run_time_s : state.run_time_s;
  if (run_time_s <= 0.0) return 1;
  const double by_time = std::ceil(state.config.lease_work_s / run_time_s);
  const auto rounds = static_cast<std::uint64_t>(
      std::clamp(by_time, 2.0, static_cast<double>(wire::runs_per_lease_max)));
  const std::uint64_t slots = 2 * num_slots(state);
  const std::uint64_t by_share = (num_pending(state) + slots - 1) / slots;
  return std::max<std::uint64_t>(1, std::min(rounds, by_share));
}

/// True if the worker needs nothing yet: it would not run low before the next of its results.
bool has_enough(const Worker& worker, std::uint64_t wanted) {
  const std::uint64_t two_rounds = 2 * static_cast<std::uint64_t>(worker.num_slots);
  return worker.num_lent >= std::min(wanted, two_rounds) && 2 * worker.num_lent > wanted;
}

std::vector<double> table_values(const Campaign& campaign, RunRange runs) {
  std::vector<double> values;
  if (campaign.table_columns.empty()) return values;
  for (std::uint64_t run = runs.first.value; run < runs.end(); ++run) {
    const std::vector<double> row = campaign.table_values({run});
    values.insert(values.end(), row.begin(), row.end());
  }
  return values;
}

/// Runs that were lent before come first, so that a campaign's early runs do not wait for its end.
void lend_range(State& state, WorkerId id, Worker& worker, std::uint64_t count_max, TimePoint now,
                Outbox& outbox) {
  const auto newest = std::prev(state.pending.end());
  const Attempt attempt = newest->first;
  const RunRange runs = newest->second.take_first(count_max);
  if (newest->second.empty()) state.pending.erase(newest);

  const LeaseId lease{state.next_lease++};
  state.leases.emplace(
      lease, Lease{.worker = id, .attempt = attempt, .remaining = RunSet(runs), .lent_at = now});
  worker.num_lent += runs.count;
  outbox.send(id, wire::RunLease{.lease = lease,
                                 .runs = runs,
                                 .attempt = attempt,
                                 .table_values = table_values(*state.campaign, runs)});
}

}  // namespace

void lend(State& state, WorkerId id, TimePoint now, Outbox& outbox) {
  if (!state.is_lending) return;
  Worker& worker = state.workers.at(id);
  const std::uint64_t wanted =
      std::min<std::uint64_t>(worker.num_slots * rounds_wanted(state, worker), worker.num_runs_max);
  if (has_enough(worker, wanted)) return;
  while (worker.num_lent < wanted && !state.pending.empty()) {
    const std::uint64_t count_max =
        std::min<std::uint64_t>(wanted - worker.num_lent, wire::runs_per_lease_max);
    lend_range(state, id, worker, count_max, now, outbox);
  }
}

void lend_to_all(State& state, TimePoint now, Outbox& outbox) {
  for (const auto& [id, worker] : state.workers) lend(state, id, now, outbox);
}

void take_back(State& state, std::map<LeaseId, Lease>::iterator lease, Outbox& outbox) {
  Lease& lost = lease->second;
  outbox.log(
      {.severity = Severity::warning,
       .kind = "lease_expired",
       .text = fmt::format("worker={} lease={} runs={} attempt={}", lost.worker.value,
                           lease->first.value, to_text(lost.remaining), lost.attempt.value)});
  state.workers.at(lost.worker).num_lent -= lost.remaining.size();
  RunSet& pending = state.pending[Attempt{lost.attempt.value + 1}];
  for (const RunRange& range : lost.remaining.ranges()) pending.add(range);
  state.leases.erase(lease);
}

void take_back_all(State& state, WorkerId worker, Outbox& outbox) {
  for (auto lease = state.leases.begin(); lease != state.leases.end();) {
    const auto current = lease++;
    if (current->second.worker == worker) take_back(state, current, outbox);
  }
}

namespace {

bool remove_from_lease(State& state, RunIndex run, std::map<LeaseId, Lease>::iterator lease) {
  if (lease == state.leases.end() || !lease->second.remaining.remove(run)) return false;
  --state.workers.at(lease->second.worker).num_lent;
  if (lease->second.remaining.empty()) state.leases.erase(lease);
  return true;
}

bool remove_from_pending(State& state, RunIndex run) {
  for (auto runs = state.pending.begin(); runs != state.pending.end(); ++runs) {
    if (!runs->second.remove(run)) continue;
    if (runs->second.empty()) state.pending.erase(runs);
    return true;
  }
  return false;
}

}  // namespace

bool close_run(State& state, RunIndex run, LeaseId computed_under) {
  if (remove_from_lease(state, run, state.leases.find(computed_under))) return true;
  if (remove_from_pending(state, run)) return true;
  // A late result: its run has been lent again, under another lease.
  for (auto lease = state.leases.begin(); lease != state.leases.end(); ++lease) {
    if (remove_from_lease(state, run, lease)) return true;
  }
  return false;
}

}  // namespace proofmass::coordinator::detail
