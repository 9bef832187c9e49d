#pragma once

#include <filesystem>
#include <string>

namespace proofmass::coordinator {

/// An `ipc://` address in a new directory that only this user can enter; the directory goes with
/// the object.
class PrivateEndpoint {
 public:
  PrivateEndpoint();  ///< @throws Error if the directory cannot be made.
  ~PrivateEndpoint();
  PrivateEndpoint(const PrivateEndpoint&) = delete;
  PrivateEndpoint& operator=(const PrivateEndpoint&) = delete;

  [[nodiscard]] std::string address() const;

 private:
  std::filesystem::path directory_;
};

}  // namespace proofmass::coordinator
