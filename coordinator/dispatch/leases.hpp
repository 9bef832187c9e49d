#pragma once

#include <map>
#include <span>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

// The places of runs: the only functions that move runs between pending, leases, delivered and
// given up. They keep the counts of these places right.

namespace proofmass::coordinator::detail {

using RunsByCampaign = std::map<CampaignId, RunSet>;
using RunsByWorker = std::map<WorkerId, RunSet>;

/// Notes whether the worker may be lent runs, and counts its slots accordingly.
void set_eligible(State& state, Worker& worker, bool is_eligible);

/// The next attempt. The largest one is followed by itself, because a worker may claim any number.
[[nodiscard]] Attempt after(Attempt attempt);

/// Adds a lease to the state and to all counts of leases.
/// @pre Runs of a first lease have no other place; those of a copy are in `lent`.
LeaseId open_lease(State& state, Lease lease);

/// Takes runs off a lease, and ends the lease if they were its last ones. The caller gives the runs
/// another place.
/// @pre The runs are on the lease.
void take_off(State& state, LeaseId lease, RunRange runs);

/// To be called before runs are taken off a lease while their worker may still compute them.
void note_unleased(State& state, LeaseId lease, RunRange runs);

/// To be called when a worker is lent runs of a campaign, and before anything of it is written to
/// the campaign's file: the file then knows it. A worker that was lent none changes no file.
void note_joined(CampaignId campaign, Worker& worker, Outbox& outbox);

/// The worker will not deliver these runs of a lease: they become pending again, or go on at a
/// worker that has a copy.
/// @param blamed  Runs against which the loss counts; of this campaign.
void lose(State& state, LeaseId lease, const RunSet& runs, LossReason reason, const RunSet& blamed,
          Outbox& outbox);

/// Makes runs that have no place pending. Runs that crashed too many workers are given up instead.
void make_pending(State& state, CampaignId id, RunSet runs, Attempt attempt, Outbox& outbox);

/// Notes that committed runs are to be computed a second time.
void add_to_audit(CampaignState& campaign, const AuditKey& key, const RunSet& runs);

/// Removes a run from wherever it is open.
/// @param by       The worker that has its result.
/// @param holders  Gets the run for each other worker to which it was lent.
/// @return False if the run is not open: delivered or committed.
bool close_run(State& state, CampaignId id, RunIndex run, WorkerId by, RunsByWorker& holders);

/// All runs on the worker's leases.
[[nodiscard]] RunsByCampaign leased_runs(const State& state, const Worker& worker);

/// Asks the worker to give back those of the runs that it has not begun.
void send_retract(WorkerId worker, CampaignId campaign, const RunSet& runs, Outbox& outbox);

/// Forgets the worker. All runs on its leases are lost for this reason.
/// @param blamed  As in lose(), of all campaigns.
void remove_worker(State& state, WorkerId id, LossReason reason, const RunsByCampaign& blamed,
                   Outbox& outbox);

}  // namespace proofmass::coordinator::detail
