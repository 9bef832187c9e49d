#pragma once

#include "coordinator/factory/batch_system.hpp"
#include "coordinator/factory/factory.hpp"

namespace proofmass::coordinator {

/// Has the batch system cancel and take the allocations that were decided on.
///
/// An allocation that cannot be cancelled changes nothing else: it has ended already, or its worker
/// leaves when it finds no work. After a submission that is refused no further one is tried.
///
/// @param log  Is told of each of them.
void carry_out(const FactoryActions& actions, FactoryState& state, const BatchSystem& system,
               const AllocationConfig& allocation, const wire::Log& log);

}  // namespace proofmass::coordinator
