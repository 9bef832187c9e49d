#pragma once

#include <set>
#include <vector>

#include "coordinator/net/prepared_campaign.hpp"
#include "coordinator/net/service.hpp"

namespace proofmass::coordinator {

/// What a service begins with.
struct Beginning {
  CoordinatorStart start;
  std::vector<FileOutcome> campaigns;  ///< Those that are handed over first.
  std::set<SessionId> attached;        ///< Workers that may come back.
};

/// Reads what must be known of the campaigns that are handed over and of those in the directory.
/// @throws Error, StoreError if one that is handed over cannot be served, or the directory cannot
///         be read.
[[nodiscard]] Beginning beginning_of(std::vector<ServedCampaign> campaigns,
                                     const ServiceConfig& config);

}  // namespace proofmass::coordinator
