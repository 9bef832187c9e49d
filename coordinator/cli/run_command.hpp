#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/override_options.hpp"

namespace proofmass::coordinator {

/// Arguments of `proofmass run`.
struct RunOptions {
  std::filesystem::path campaign_file;
  std::optional<std::filesystem::path> database;  ///< By default STEM.db in the current directory.
  Overrides overrides;
  std::optional<unsigned> num_workers;  ///< By default one for each processor.
  double audit_fraction = 0.0;          ///< Of the runs that are missing, computed twice; 0 to 1.
  StopOptions stop;
  bool is_quiet = false;
};

/// Runs what is missing of a campaign with local workers and prints its tables. A run that crashes
/// its workers is given up, and tried again the next time.
///
/// @return An ExitCode; exit_not_met if all runs together do not reach the stop rule.
/// @throws DefinitionError, UsageError, StoreError, Error.
[[nodiscard]] int run_campaign(const RunOptions& options);

}  // namespace proofmass::coordinator
