#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/net/service.hpp"
#include "coordinator/net/submission_limits.hpp"
#include "proto/link/log.hpp"

namespace proofmass::coordinator {

/// Arguments of `proofmass-coordinator`.
struct ServeOptions {
  std::filesystem::path directory;              ///< Of the campaign files.
  std::string endpoint;                         ///< For workers.
  std::optional<std::string> clients_endpoint;  ///< By default a socket in the directory.
  std::optional<std::filesystem::path> keys;    ///< Directory of `proofmass keygen`.
  bool is_plain_waived = false;
  ServiceEnd end = ServiceEnd::never;
  double drain_time_s = 120.0;          ///< ≥ 0.
  std::uint64_t memory_mib_max = 2048;  ///< ≥ 64; of the process.
  SubmissionLimits limits;              ///< Of each client's key.
  wire::LogFormat log_format = wire::LogFormat::text;
  std::string faults;       ///< As FaultPlan::parse() reads them.
  double time_scale = 1.0;  ///< > 0; of all that is waited for. Below 1 in tests of this program.
  std::vector<std::filesystem::path> campaign_files;  ///< To be served beside those that are there.
};

/// Serves all campaigns of a directory to the workers that connect.
/// @return An ExitCode.
/// @throws DefinitionError, UsageError, InvalidArgument, StoreError, Error.
[[nodiscard]] int serve_campaigns(const ServeOptions& options);

}  // namespace proofmass::coordinator
