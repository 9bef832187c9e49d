#pragma once

#include <span>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator::detail {

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

/// True if runs of the campaign are lent.
[[nodiscard]] bool is_lent(const CampaignState& campaign);

/// True if so many results wait for the store that no more runs are lent for now.
[[nodiscard]] bool is_backed_up(const State& state, const CampaignState& campaign);

/// Tells the worker of a new lease.
void send_lease(State& state, LeaseId lease, Outbox& outbox);

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

/// Ends the campaign if it is finished.
void finish_if_done(State& state, CampaignId id, Outbox& outbox);

/// To be called after runs were lost or given up: ends campaigns that are finished now, and lends
/// runs to workers that would take more.
void settle(State& state, TimePoint now, Outbox& outbox);

/// The end of a campaign: no run is pending, and some workers are idle while others still compute.
/// Idle workers first receive runs that wait at other workers, and then copies of runs that take
/// too long.
void speculate(State& state, TimePoint now, Outbox& outbox);

}  // namespace proofmass::coordinator::detail
