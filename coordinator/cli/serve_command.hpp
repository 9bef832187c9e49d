#pragma once

#include <filesystem>
#include <string>

namespace proofmass::coordinator {

/// Arguments of `proofmass-coordinator`.
struct ServeOptions {
  std::filesystem::path campaign_file;
  std::filesystem::path database;
  std::string endpoint;
};

/// Serves a campaign's runs to the workers that connect, until all are stored.
/// @return An ExitCode.
/// @throws CampaignFileError, UsageError, InvalidArgument, StoreError, Error.
[[nodiscard]] int serve_campaign(const ServeOptions& options);

}  // namespace proofmass::coordinator
