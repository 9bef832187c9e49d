#pragma once

#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator {

/// Aborts if the state contradicts itself: if a run has no place or two of them, or a count does
/// not agree with what it counts. Walks the whole state.
void check_invariants(const State& state);

}  // namespace proofmass::coordinator
