#pragma once

#include <string>

#include "coordinator/cli/client_options.hpp"

namespace proofmass::coordinator {

/// Arguments of `proofmass release`.
struct ReleaseOptions {
  ClientOptions client;
  std::string host;
};

/// Ends a host's quarantine: runs are lent to its workers again.
/// @return An ExitCode.
/// @throws UsageError if no host has such a name; as ClientConnection does; Error if the
///         coordinator refuses.
[[nodiscard]] int release_host(const ReleaseOptions& options);

}  // namespace proofmass::coordinator
