#pragma once

#include "coordinator/cli/client_options.hpp"

namespace proofmass::coordinator {

/// `proofmass status`: prints where every campaign of a coordinator stands.
/// @return An ExitCode.
/// @throws As ClientConnection does; Error if the coordinator refuses.
[[nodiscard]] int show_status(const ClientOptions& options);

}  // namespace proofmass::coordinator
