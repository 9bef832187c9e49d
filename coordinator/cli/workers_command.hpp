#pragma once

#include "coordinator/cli/client_options.hpp"

namespace proofmass::coordinator {

/// `proofmass workers`: prints who computes for a coordinator.
/// @return An ExitCode.
/// @throws As ClientConnection does; Error if the coordinator refuses.
[[nodiscard]] int show_workers(const ClientOptions& options);

}  // namespace proofmass::coordinator
