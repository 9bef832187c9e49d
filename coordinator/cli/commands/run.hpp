#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/shared_options.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {

/// What is printed when a campaign has run.
enum class RunOutput : std::uint8_t { tables, json, none };

/// How a campaign is run on this machine.
struct RunOptions {
  std::filesystem::path campaign_file;
  std::optional<std::filesystem::path> database;  ///< By default STEM.db in the current directory.
  Overrides overrides;
  std::optional<unsigned> num_workers;   ///< By default one for each processor.
  std::string gpus = "none";             ///< Cards of this machine, as for a worker.
  std::optional<double> audit_fraction;  ///< Of the runs that are missing, computed twice; 0 to 1.
  std::optional<RunRange> part;          ///< Only these runs are computed.
  StopPlan stop;                         ///< Without StopPlan::num_runs_max.
  PageConfig page;
  bool is_quiet = false;
  RunOutput output = RunOutput::tables;
};

/// Declares the options of `run` that say which campaign is run and how, but for FILE, --db,
/// --range and those of the page.
/// @param options  Lives as long as the command.
void add_run_options(CLI::App& command, RunOptions& options);

/// What a database may be asked for by `run` and its options.
[[nodiscard]] StopPlan stop_plan_of(const RunOptions& options, std::uint64_t num_runs);

/// Runs what is missing of a campaign with local workers and prints its tables. A run that crashes
/// its workers is given up, and tried again the next time.
/// @return An ExitCode; exit_not_met if all runs together do not reach the stop rule, or if
///         audits contradict them.
/// @throws Error if the campaign file, the database or the workers cannot be used.
[[nodiscard]] int run_campaign(const RunOptions& options);

}  // namespace proofmass::coordinator
