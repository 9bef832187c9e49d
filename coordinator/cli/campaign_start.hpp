#pragma once

#include <filesystem>
#include <memory>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/net/campaign_service.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// The campaign that a database holds.
[[nodiscard]] Campaign stored_campaign(const Store& store);

/// The database for a campaign: a new one, or the one that exists, with more runs if more are asked
/// for.
/// @throws UsageError if it holds another campaign, naming what differs, or more runs than wanted.
/// @throws StoreError if it cannot be used.
[[nodiscard]] Store open_or_create(const Campaign& wanted, const std::filesystem::path& database);

/// Stores deliveries; a result that contradicts the stored one goes into the log.
[[nodiscard]] Commit commit_to(Store& store, Log log);

}  // namespace proofmass::coordinator
