#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace proofmass::coordinator {

struct KeygenOptions {
  std::filesystem::path directory;
  std::optional<std::string> worker;  ///< Adds a pair of this name for another worker.
  std::optional<std::string> client;  ///< Likewise for a client.
};

/// Makes a directory with the keys of a coordinator, of workers and of clients, and the lists of
/// who may connect; or adds pairs to one. Says what to copy where.
///
/// @return An ExitCode.
/// @throws UsageError if a file exists that would be replaced, or a name is not one; Error if a
/// file
///         cannot be written.
[[nodiscard]] int make_keys(const KeygenOptions& options);

}  // namespace proofmass::coordinator
