#pragma once

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator::detail {

/// The end of a campaign: no run is pending, and some workers are idle while others still compute.
/// Idle workers first receive runs that wait at other workers, and then copies of runs that take
/// too long.
void speculate(State& state, TimePoint now, Outbox& outbox);

}  // namespace proofmass::coordinator::detail
