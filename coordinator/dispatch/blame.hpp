#pragma once

#include "coordinator/dispatch/leases.hpp"
#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

// What counts against a run. A crash ends all runs that a worker computes, and most of them did not
// cause it. Therefore they are tried again, each alone, before one of them is given up.

namespace proofmass::coordinator::detail {

/// The worker's process crashed: counts the crash against the runs that it computed, and against
/// its host.
/// @return The runs against which the crash counts.
RunsByCampaign blame_crash(State& state, WorkerId worker, Outbox& outbox);

/// As blame_crash(), for a batch that hangs.
RunsByCampaign blame_batch(State& state, WorkerId worker, const wire::ComputedBatch& batch,
                           Outbox& outbox);

/// True if a run crashed so often that it must be the cause: on hosts that have delivered results,
/// or, alone, on two different ones.
[[nodiscard]] bool is_guilty(const State& state, const Suspicion& suspicion);

/// The run is not lent again. @pre It is a suspect, and has no place.
void give_up(State& state, CampaignId id, RunIndex run, Outbox& outbox);

/// True if the worker may be lent this suspect. A suspect is tried on a host on which it has not
/// crashed yet, as long as there is one: otherwise a bad host could make a good run be given up.
[[nodiscard]] bool may_try(const State& state, const Suspicion& suspicion, const Worker& worker);

}  // namespace proofmass::coordinator::detail
