#pragma once

#include "coordinator/dispatch/leases.hpp"
#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

// What counts against a run. A crash ends all that a worker computes, so most runs that it is
// blamed on are innocent: they are tried again, alone, before one is given up.

namespace proofmass::coordinator::detail {

/// The worker's process crashed: blames what it computed, and counts against its host.
/// @return The runs against which it counts.
RunsByCampaign blame_crash(State& state, WorkerId worker, Outbox& outbox);

/// The same for a batch that hangs.
RunsByCampaign blame_batch(State& state, WorkerId worker, const wire::ComputedBatch& batch,
                           Outbox& outbox);

/// True if a run crashed so often that it must be the cause: on hosts that have delivered results,
/// or, alone, on two different ones.
[[nodiscard]] bool is_guilty(const State& state, const Suspicion& suspicion);

/// The run is not lent again. @pre It is suspected, and has no place.
void give_up(State& state, CampaignId id, RunIndex run, Outbox& outbox);

/// True if the worker may be lent this suspect: it should crash on another host the next time, so
/// that a bad host does not condemn it.
[[nodiscard]] bool may_try(const State& state, const Suspicion& suspicion, const Worker& worker);

}  // namespace proofmass::coordinator::detail
