#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "coordinator/dispatch/run_set.hpp"
#include "core/campaign/campaign.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::coordinator {

using wire::Attempt;
using wire::LeaseId;
using wire::WorkerId;

/// A monotonic time, handed in by the caller: nothing in the dispatch reads a clock.
using TimePoint = std::chrono::steady_clock::time_point;
using Duration = std::chrono::steady_clock::duration;

/// Settings of the dispatch.
struct DispatchConfig {
  Duration heartbeat_interval = std::chrono::seconds(2);  ///< Asked of every worker.
  Duration lost_after = std::chrono::seconds(30);         ///< Of silence, then runs are lent again.
  /// A lease that a heartbeat does not list, this long after it was sent, did not arrive. Longer
  /// than a message and its answer ever take while the worker is not lost.
  Duration lease_arrival_max = std::chrono::seconds(10);
  double lease_work_s = 1.5;  ///< Work that a slot is lent at a time, once run times are known.
  std::size_t num_workers_max = 4096;
};

/// A registered worker.
struct Worker {
  std::string name;
  std::string host;
  std::uint64_t process_id = 0;
  std::uint32_t num_slots = 1;
  TimePoint heard_at;              ///< Last message of any kind.
  std::uint32_t num_runs_max = 0;  ///< Its credit: most unfinished runs that it wants to hold.
  std::uint64_t num_lent = 0;      ///< Runs on its leases, as far as the coordinator knows.
  std::uint64_t num_orbits_done = 0;
  double run_time_s = 0.0;  ///< Running mean of what a run takes in its slot; 0: not known yet.
};

/// Runs lent to a worker. It exists while one of them has not been delivered.
struct Lease {
  WorkerId worker;
  Attempt attempt;
  RunSet remaining;
  TimePoint lent_at;
};

/// All that the dispatch knows. Each run of the campaign is in exactly one of `pending`, the
/// leases, `delivered` and `committed`. Only the functions of dispatch.hpp change it.
struct State {
  DispatchConfig config;
  std::shared_ptr<const Campaign> campaign;  ///< Shared with Welcome messages under way.
  std::map<WorkerId, Worker> workers;
  std::map<Attempt, RunSet> pending;  ///< By the attempt under which they will be lent.
  std::map<LeaseId, Lease> leases;
  /// Handed to the store and not committed yet, with the workers that wait for the acknowledgement.
  std::map<RunIndex, std::vector<WorkerId>> delivered;
  RunSet committed;
  std::uint64_t next_lease = 1;
  double run_time_s = 0.0;                 ///< Running mean over all workers; 0 if not known yet.
  bool is_lending = true;                  ///< False once the campaign ends or is stopped.
  std::uint64_t num_committed_here = 0;    ///< Without those that were finished before.
  std::uint64_t num_without_estimate = 0;  ///< Delivered here, with a status that has none.
  std::uint64_t num_duplicates = 0;        ///< Results that were there already.
};

/// A campaign of which the `finished` runs are in the store.
/// @pre campaign->validate() passed; the finished runs are below campaign->num_runs.
[[nodiscard]] State initial_state(std::shared_ptr<const Campaign> campaign,
                                  std::span<const RunRange> finished, const DispatchConfig& config);

/// True if every run is durably stored.
[[nodiscard]] bool is_finished(const State& state);

/// True if no result is expected or on its way to the store any more.
[[nodiscard]] bool is_quiet(const State& state);

/// Runs on the worker's leases.
[[nodiscard]] RunSet runs_held(const State& state, WorkerId worker);

/// Aborts if the state contradicts itself. Walks all of it: for tests.
void check_invariants(const State& state);

}  // namespace proofmass::coordinator
