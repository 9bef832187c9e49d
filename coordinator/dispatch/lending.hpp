#pragma once

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator::detail {

/// Lends the worker what brings it to its share, if it has run low.
void lend(State& state, WorkerId worker, TimePoint now, Outbox& outbox);

/// The same for every worker, in the order of registration.
void lend_to_all(State& state, TimePoint now, Outbox& outbox);

/// Takes the lease back; its remaining runs will be lent under the next attempt.
void take_back(State& state, std::map<LeaseId, Lease>::iterator lease, Outbox& outbox);

/// Takes back all that the worker holds.
void take_back_all(State& state, WorkerId worker, Outbox& outbox);

/// Removes the run from wherever it is open.
/// @return False if it is not open: delivered or committed already.
bool close_run(State& state, RunIndex run, LeaseId computed_under);

}  // namespace proofmass::coordinator::detail
