#pragma once

#include <string>

#include "coordinator/cli/client_options.hpp"

namespace proofmass::coordinator {

/// Arguments of `proofmass pause`, `resume` and `cancel`.
struct ControlOptions {
  ClientOptions client;
  wire::ControlAction action = wire::ControlAction::pause;
  std::string campaign;
};

/// Pauses, resumes or cancels a campaign of a coordinator.
/// @return An ExitCode.
/// @throws UsageError if no campaign has such a name; as ClientConnection does; Error if the
///         coordinator refuses.
[[nodiscard]] int control_campaign(const ControlOptions& options);

}  // namespace proofmass::coordinator
