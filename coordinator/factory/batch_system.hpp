#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
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

/// What each allocation is to be.
struct AllocationConfig {
  std::string name;            ///< Of the factory; is_name() holds.
  std::string worker_command;  ///< A line of `sh` that ends as a worker named NAME-"$1".
  std::chrono::seconds walltime = std::chrono::hours(8);
  std::optional<unsigned> num_processors;  ///< Of the worker; nothing: a node of its own.
  std::vector<std::string> options;        ///< Further ones, as the batch system has them.
};

/// What a batch system understands. Each of the functions is pure: nothing is started.
struct BatchSystem {
  std::string_view name;  ///< As people choose it: `slurm`.
  /// Puts one allocation into the queue.
  BatchCommand (*submission)(const AllocationConfig& config);
  /// Its identifier. @throws Error if the output has none.
  std::string (*id_of)(std::string_view output);
  /// Lists the allocations of the factory.
  BatchCommand (*listing)(const AllocationConfig& config);
  /// The allocations in what `listing` printed. @throws Error if it cannot be read.
  std::vector<Allocation> (*allocations_of)(const AllocationConfig& config,
                                            std::string_view output);
  BatchCommand (*cancellation)(const std::string& id);
};

/// slurm, pbs, condor and local; `local` starts workers on this machine, for trials.
[[nodiscard]] const std::vector<BatchSystem>& batch_systems();

/// Starts the program and waits for its end, at most a minute.
/// @return What it wrote to standard output, at most 1 MiB of it.
/// @throws Error with the program's name and its last words if it cannot be started, does not end
/// in
///         time, or ends with another exit code than 0.
[[nodiscard]] std::string output_of(const BatchCommand& command);

}  // namespace proofmass::coordinator
