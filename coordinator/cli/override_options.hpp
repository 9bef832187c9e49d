#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "coordinator/campaign_file/campaign_file.hpp"

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::coordinator {

/// Declares --runs, --seed and --set.
/// @param overrides  Lives as long as the command.
void add_override_options(CLI::App& command, Overrides& overrides);

/// When a campaign ends before all of its runs are finished.
struct StopOptions {
  std::string rule;                           ///< See parse_stop_rule(); empty for none.
  std::optional<std::uint64_t> failures_max;  ///< Runs without an estimate.
};

/// A requirement about a quantity of the model, for help texts: `gain < 1e-3 for 99% with 95%`.
[[nodiscard]] std::string example_requirement();

/// Declares --until and --failures.
/// @param options  Lives as long as the command.
void add_stop_options(CLI::App& command, StopOptions& options);

/// Declares --audit.
/// @param audit_fraction  Lives as long as the command.
void add_audit_option(CLI::App& command, std::optional<double>& audit_fraction);

}  // namespace proofmass::coordinator
