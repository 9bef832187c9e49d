#pragma once

#include <filesystem>
#include <string>

#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

/// An `ipc://` address in a new directory `proofmass-run-XXXXXX` that only this user can enter; the
/// directory goes with the object. A process that is killed leaves its directory: the next object
/// removes it, which knows it by a lock that nobody holds any more.
///
/// A socket in a directory of mode 0700 can be reached by this user alone. An abstract address
/// would leave nothing behind, but any user of the machine could connect to it.
class PrivateEndpoint {
 public:
  PrivateEndpoint();  ///< @throws Error if the directory cannot be made.
  ~PrivateEndpoint();

  [[nodiscard]] std::string address() const;

  /// A socket that listens at the address: whoever connects waits until it is served, by a service
  /// that takes the descriptor over (ServiceConfig).
  /// @throws Error if there can be none.
  [[nodiscard]] int listen() const;

 private:
  std::filesystem::path directory_;
  wire::Descriptor lock_;  ///< In the directory.
};

/// Removes what killed processes of this user left in a directory: directories
/// `proofmass-run-XXXXXX` of mode 0700 that hold a lock which nobody holds, a socket, and nothing
/// else. Leaves everything else alone, and ignores failures.
void remove_stale_endpoints(const std::filesystem::path& parent);

}  // namespace proofmass::coordinator
