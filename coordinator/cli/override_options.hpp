#pragma once

#include "coordinator/campaign_file/campaign_file.hpp"

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::coordinator {

/// Declares --runs, --seed and --set.
/// @param overrides  Lives as long as the command.
void add_override_options(CLI::App& command, Overrides& overrides);

/// Declares --audit.
/// @param audit_fraction  Lives as long as the command.
void add_audit_option(CLI::App& command, double& audit_fraction);

}  // namespace proofmass::coordinator
