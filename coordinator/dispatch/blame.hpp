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

/// Gives up suspects that crashed as often on hosts that have delivered results, and that no other
/// host has tried for long although nothing else was lent.
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

}  // namespace proofmass::coordinator::detail
