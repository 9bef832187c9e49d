#pragma once

#include <map>
#include <span>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

// Where runs are: the only functions that move them between pending, leases, delivered and given
// up, and keep what counts them.

namespace proofmass::coordinator::detail {

using RunsByCampaign = std::map<CampaignId, RunSet>;
using RunsByWorker = std::map<WorkerId, RunSet>;

/// The attempt that follows; the largest follows itself, because a worker may claim any.
[[nodiscard]] Attempt after(Attempt attempt);

/// Adds a lease to the state and to all that counts leases.
/// @pre Runs of a first lease have no other place; those of a copy are in `lent`.
LeaseId open_lease(State& state, Lease lease);

/// Takes runs off a lease, which ends with the last one. What becomes of them is up to the caller.
/// @pre They are on it.
void take_off(State& state, LeaseId lease, RunRange runs);

/// To be called before runs are taken off a lease though their worker may go on with them.
void note_unleased(State& state, LeaseId lease, RunRange runs);

/// The worker will not deliver these runs of a lease: they are open again, or on a copy.
/// @param blamed  Runs against which the loss counts; of this campaign.
void lose(State& state, LeaseId lease, const RunSet& runs, LossReason reason, const RunSet& blamed,
          Outbox& outbox);

/// Gives runs without a place the one of pending ones; those that crashed too many workers are
/// given up.
void make_pending(State& state, CampaignId id, RunSet runs, Attempt attempt, Outbox& outbox);

/// Committed runs are to be computed a second time.
void add_to_audit(CampaignState& campaign, const AuditKey& key, const RunSet& runs);

/// Removes a run from wherever it is open.
/// @param by       Who has its result.
/// @param holders  Gets the run for each other worker to which it was lent.
/// @return False if the run is not open: delivered or committed.
bool close_run(State& state, CampaignId id, RunIndex run, WorkerId by, RunsByWorker& holders);

/// All runs on the worker's leases.
[[nodiscard]] RunsByCampaign leased_runs(const State& state, const Worker& worker);

/// Asks the worker to give back what it does not compute yet.
void send_retract(WorkerId worker, CampaignId campaign, const RunSet& runs, Outbox& outbox);

/// Forgets the worker; all that it holds is lost for this reason.
void remove_worker(State& state, WorkerId id, LossReason reason, const RunsByCampaign& blamed,
                   Outbox& outbox);

}  // namespace proofmass::coordinator::detail
