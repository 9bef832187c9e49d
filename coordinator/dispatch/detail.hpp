#pragma once

#include <cstdint>
#include <map>
#include <span>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

// What the events have in common. Each part is implemented in the source of its name.

namespace proofmass::proto {
class Heartbeat;
}  // namespace proofmass::proto

namespace proofmass::coordinator::detail {

/// The worker that sent a message, with the time noted at which it was heard. If it is not
/// registered, it is told so, and the result is null.
Worker* heard(State& state, WorkerId id, TimePoint now, Outbox& outbox);

// The places of runs: the only functions that move runs between pending, leases, delivered and
// given up. They keep the counts of these places right.

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

void send_lease(State& state, LeaseId lease, Outbox& outbox);

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
/// Those of one campaign.
[[nodiscard]] RunSet leased_runs(const State& state, const Worker& worker, CampaignId campaign);

/// Asks the worker to give back those of the runs that it has not begun.
void send_retract(WorkerId worker, CampaignId campaign, const RunSet& runs, Outbox& outbox);

/// Forgets the worker. All runs on its leases are lost for this reason.
/// @param blamed  As in lose(), of all campaigns.
void remove_worker(State& state, WorkerId id, LossReason reason, const RunsByCampaign& blamed,
                   Outbox& outbox);

// What counts against a run. A crash ends all runs that a worker computes, and most of them did not
// cause it. Therefore they are tried again, each alone, before one of them is given up.

/// The worker's process crashed: counts the crash against the runs that it computed, and against
/// its host.
/// @return The runs against which the crash counts.
RunsByCampaign blame_crash(State& state, WorkerId worker, Outbox& outbox);

/// A batch hangs: counts that as a crash against its runs, and against the host of its worker.
/// @return The runs against which it counts.
RunsByCampaign blame_batch(State& state, WorkerId worker, const Progress& batch, Outbox& outbox);

/// What simulates these runs crashed outside the worker's process, all of them together: counts
/// that as a crash against those that are lent to it, and against the campaign at this worker.
/// @return The runs against which it counts.
RunsByCampaign blame_simulation(State& state, WorkerId worker, CampaignId campaign,
                                const RunSet& runs, Outbox& outbox);

/// Campaigns that crashed too often in a row at a worker, and not because of runs that have been
/// given up, pause there; those that have paused for long enough are tried again.
void pause_crashing_campaigns(State& state, Outbox& outbox);

/// True if a run crashed so often, on two hosts at least while it ran alone, that it must be the
/// cause.
[[nodiscard]] bool is_guilty(const State& state, const Suspicion& suspicion);

/// Gives up suspects that crashed as often on hosts that have delivered results, for which another
/// host has been awaited for long, and that no worker is going to try.
void give_up_untried(State& state, Outbox& outbox);

/// The run is not lent again. @pre It is a suspect, and has no place.
void give_up(State& state, CampaignId id, RunIndex run, Outbox& outbox);

/// Counts that the run is lent to the worker alone, or found there and left to it.
void note_lent_alone(Suspicion& suspicion, const Worker& worker, TimePoint now);

/// True if the worker may be lent this suspect, or keep it if it holds it. A suspect is tried on
/// the host that has tried it least, and on which it has crashed least, if a worker there takes it
/// soon: otherwise a bad host could make a good run be given up, or keep it. A host whose word does
/// not suffice any more, or that has often brought nothing, does not get it again.
[[nodiscard]] bool may_try(const State& state, const Suspicion& suspicion, const Worker& worker);

// What a heartbeat says: which runs the worker holds, and how far its batches are. The
// coordinator's view and the worker's may differ, and either may be right: messages are lost in
// both directions, workers outlive coordinators, and a silent worker's runs are lent again.

/// Makes both sides agree about which runs the worker holds.
void reconcile(State& state, WorkerId id, const proto::Heartbeat& heartbeat, TimePoint now,
               Outbox& outbox);

/// To be called when a campaign is served, or has more runs than before: lends its runs to the
/// workers that have set their results aside, so that nobody computes them again.
void adopt_set_aside(State& state, CampaignId campaign, TimePoint now);

/// Notes how many steps the worker's batches have done.
void note_progress(State& state, Worker& worker, const proto::Heartbeat& heartbeat, TimePoint now);

/// The first of the worker's batches that hangs; null if none does.
[[nodiscard]] const Progress* hung_batch(const State& state, const Worker& worker, TimePoint now);

// How much of a campaign a worker is to be lent.

[[nodiscard]] constexpr std::uint64_t ratio_rounded_up(std::uint64_t a, std::uint64_t b) {
  return (a + b - 1) / b;
}

/// Lends the worker as many runs as its share allows, if it has few left.
void lend(State& state, WorkerId worker, TimePoint now, Outbox& outbox);

/// Lends runs, while there are any, to all workers that would take more.
void lend_to_hungry(State& state, TimePoint now, Outbox& outbox);

/// True if nothing is lent to the worker: it is silent, its host is under quarantine and it has
/// delivered nothing, or it tries a suspect.
[[nodiscard]] bool is_passed_over(const State& state, const Worker& worker, TimePoint now);

/// True if the worker wants runs, and is not passed over. Runs are shared among the slots of such
/// workers.
[[nodiscard]] bool may_be_lent(const State& state, const Worker& worker, TimePoint now);

/// True if the coordinator still waits for workers that were registered before its restart to say
/// what they hold. Nothing is lent meanwhile.
[[nodiscard]] bool is_reattaching(const State& state, TimePoint now);

[[nodiscard]] bool is_lent(const CampaignState& campaign);

/// True if so many results wait for the store that no more runs are lent for now.
[[nodiscard]] bool is_backed_up(const State& state, const CampaignState& campaign);

/// To be called whenever the phase or the priority of a campaign has changed.
void sort_served(State& state);

/// For a worker that names a campaign whose runs are not lent, or not any more: tells it to forget
/// them if the campaign is finished or cancelled, and otherwise to keep their results.
void send_not_served(const State& state, WorkerId worker, CampaignId campaign, Outbox& outbox);

/// send_not_served() for all workers.
void send_not_served(const State& state, CampaignId campaign, Outbox& outbox);
/// Tells the worker to keep the results of these runs; without a run, of the whole campaign.
void send_not_served(WorkerId worker, CampaignId campaign, std::span<const RunRange> runs,
                     Outbox& outbox);

void finish_if_done(State& state, CampaignId id, Outbox& outbox);

/// To be called after runs were lost or given up: ends campaigns that are finished now, and lends
/// runs to workers that would take more.
void settle(State& state, TimePoint now, Outbox& outbox);

/// The end of a campaign: no run is pending, and some workers are idle while others still compute.
/// Idle workers first receive runs that wait at other workers, and then copies of runs that take
/// too long.
void speculate(State& state, TimePoint now, Outbox& outbox);

}  // namespace proofmass::coordinator::detail
