#include "coordinator/dispatch/state.hpp"

#include <utility>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

/// Adds the ranges to a set that must hold none of them yet.
void add_disjoint(const RunSet& runs, RunSet& all) {
  const std::uint64_t size_expected = all.size() + runs.size();
  for (const RunRange& range : runs.ranges()) all.add(range);
  PROOFMASS_EXPECT(all.size() == size_expected);
}

RunSet delivered_runs(const State& state) {
  RunSet runs;
  for (const auto& entry : state.delivered) runs.add({.first = entry.first, .count = 1});
  return runs;
}

void check_leases(const State& state) {
  std::map<WorkerId, std::uint64_t> num_lent;
  for (const auto& [id, lease] : state.leases) {
    PROOFMASS_EXPECT(id.value >= 1 && id.value < state.next_lease);
    PROOFMASS_EXPECT(state.workers.contains(lease.worker));
    PROOFMASS_EXPECT(!lease.remaining.empty());
    num_lent[lease.worker] += lease.remaining.size();
  }
  for (const auto& [id, worker] : state.workers) {
    PROOFMASS_EXPECT(worker.num_lent == num_lent[id]);
  }
}

}  // namespace

State initial_state(std::shared_ptr<const Campaign> campaign, std::span<const RunRange> finished,
                    const DispatchConfig& config) {
  State state;
  state.config = config;
  state.campaign = std::move(campaign);
  RunSet open;
  std::uint64_t next = 0;
  for (const RunRange& range : finished) {
    PROOFMASS_EXPECT(range.first.value >= next && range.end() <= state.campaign->num_runs);
    open.add({.first = {next}, .count = range.first.value - next});
    state.committed.add(range);
    next = range.end();
  }
  open.add({.first = {next}, .count = state.campaign->num_runs - next});
  if (!open.empty()) state.pending.emplace(Attempt{1}, std::move(open));
  return state;
}

bool is_finished(const State& state) { return state.committed.size() == state.campaign->num_runs; }

bool is_quiet(const State& state) { return state.leases.empty() && state.delivered.empty(); }

RunSet runs_held(const State& state, WorkerId worker) {
  RunSet runs;
  for (const auto& [id, lease] : state.leases) {
    if (lease.worker != worker) continue;
    for (const RunRange& range : lease.remaining.ranges()) runs.add(range);
  }
  return runs;
}

void check_invariants(const State& state) {
  check_leases(state);
  RunSet all = state.committed;
  for (const auto& [attempt, runs] : state.pending) {
    PROOFMASS_EXPECT(attempt.value >= 1 && !runs.empty());
    add_disjoint(runs, all);
  }
  for (const auto& [id, lease] : state.leases) add_disjoint(lease.remaining, all);
  add_disjoint(delivered_runs(state), all);
  PROOFMASS_EXPECT(all == RunSet({.first = {0}, .count = state.campaign->num_runs}));
}

}  // namespace proofmass::coordinator
