#pragma once

#include <cstdint>

#include "coordinator/cli/command_line.hpp"
#include "core/microscope/simulation/run.hpp"

namespace proofmass::coordinator {

enum class BenchFormat : std::uint8_t { table, json };

/// Arguments of `proofmass bench`.
struct BenchOptions {
  BenchFormat format = BenchFormat::table;
  std::uint64_t num_runs = batch_lanes;  ///< Of each instruction set but `scalar`, which takes one.
};

/// Measures the speed of a run of the paper's campaign on one core of this machine, with every
/// instruction set that it has, compares their results and prints both.
/// @return An ExitCode: exit_cannot_be_done if results differ.
[[nodiscard]] int run_bench(const BenchOptions& options);

/// Declares `bench`.
/// @param chosen  As for add_local_commands().
void add_bench_command(CLI::App& app, Command& chosen);

}  // namespace proofmass::coordinator
