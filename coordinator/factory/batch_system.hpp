#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "coordinator/factory/factory.hpp"

namespace proofmass::coordinator {

/// A program to be started.
struct BatchCommand {
  std::vector<std::string> arguments;  ///< With the program, which is looked for in PATH.
  std::string input = {};              ///< On its standard input.
};

/// What a batch system understands.
struct BatchSystem {
  std::string_view name;  ///< As people choose it: `slurm`.
  /// Puts one allocation into the queue, and prints its identifier.
  BatchCommand (*submission)(const FactoryConfig& config);
  /// Lists the allocations of the factory, a line `ID STATE` each.
  BatchCommand (*listing)(const FactoryConfig& config);
  std::string_view lister;   ///< The program that lists them.
  std::string_view running;  ///< The state of those that have a node; empty: see allocations_of().
  std::vector<std::string> canceller;  ///< A command that the identifier completes.
};

/// slurm, pbs, condor and local; `local` starts workers on this machine, for trials.
[[nodiscard]] const std::vector<BatchSystem>& batch_systems();

/// The identifier of an allocation, in what the program printed that put it into the queue.
/// @throws Error if there is none.
[[nodiscard]] std::string id_in(std::string_view output, std::string_view program);

/// The allocations in what `listing` printed; of a system without states, which is `local`, the
/// workers of the factory among all processes.
/// @throws Error if it cannot be read.
[[nodiscard]] std::vector<Allocation> allocations_of(const BatchSystem& system,
                                                     const FactoryConfig& config,
                                                     std::string_view output);

/// Starts the program and waits for its end, at most a minute.
/// @return What it wrote to standard output, at most 1 MiB of it.
/// @throws Error with the program's name and its last words if it cannot be started, does not end
///         in time, or ends with another exit code than 0.
[[nodiscard]] std::string output_of(const BatchCommand& command);

/// Has the batch system cancel and take the allocations that were decided on.
///
/// An allocation that cannot be cancelled changes nothing else: it has ended already, or its worker
/// leaves when it finds no work. After a submission that is refused no further one is tried.
///
/// @param log  Is told of each of them.
void carry_out(const FactoryActions& actions, FactoryState& state, const BatchSystem& system,
               const FactoryConfig& config, const wire::Log& log);

}  // namespace proofmass::coordinator
