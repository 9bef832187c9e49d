#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/client.hpp"
#include "coordinator/cli/override_options.hpp"

namespace proofmass::coordinator {

/// Arguments of `proofmass submit`.
struct SubmitOptions {
  ClientOptions client;
  std::filesystem::path campaign_file;
  Overrides overrides;
  std::optional<std::string> name;       ///< By default the one in the file.
  std::optional<int> priority;           ///< -100 to 100; as it is without one.
  std::optional<double> audit_fraction;  ///< 0 to 1; likewise.
  StopOptions stop;
};

/// The campaign that the arguments name.
/// @throws DefinitionError if the file cannot be used; UsageError if the name cannot.
[[nodiscard]] std::unique_ptr<Campaign> campaign_to_submit(const SubmitOptions& options);

/// The request that the arguments ask for.
[[nodiscard]] wire::SubmitRequest submit_request(const SubmitOptions& options,
                                                 const Campaign& campaign);

}  // namespace proofmass::coordinator
