#pragma once

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator::detail {

/// Lends the worker what brings it to its share, if it has run low.
void lend(State& state, WorkerId worker, TimePoint now, Outbox& outbox);

/// The same for all workers that would take more, while there is something to lend.
void lend_to_hungry(State& state, TimePoint now, Outbox& outbox);

/// True if nothing is lent to the worker: it may be gone, or its host crashes what it computes, or
/// it tries a suspect.
[[nodiscard]] bool is_passed_over(const State& state, const Worker& worker, TimePoint now);

/// True if workers that were attached before may still say what they hold: nothing is lent.
[[nodiscard]] bool is_reattaching(const State& state, TimePoint now);

/// True if runs of the campaign are lent.
[[nodiscard]] bool is_lent(const CampaignState& campaign);

/// True if so many results wait for the store that no more runs are lent for now.
[[nodiscard]] bool is_backed_up(const State& state, const CampaignState& campaign);

/// Tells the worker of a new lease.
void send_lease(const State& state, LeaseId lease, Outbox& outbox);

/// To be called after all that changes the phase or the priority of a campaign.
void sort_served(State& state);

/// Tells a worker that names a campaign whose runs are not lent (any more) what to do with them:
/// to forget them if the campaign is finished or cancelled, or else to keep their results.
void send_not_served(const State& state, WorkerId worker, CampaignId campaign, Outbox& outbox);

/// Ends the campaign if it is finished.
void finish_if_done(State& state, CampaignId id, Outbox& outbox);

/// After runs were lost, or given up: ends campaigns and lends to workers that wait.
void settle(State& state, TimePoint now, Outbox& outbox);

}  // namespace proofmass::coordinator::detail
