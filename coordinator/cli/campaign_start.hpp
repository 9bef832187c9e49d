#pragma once

#include <filesystem>
#include <memory>
#include <string_view>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// Gives a campaign's database as many runs as are wanted.
///
/// @param remedy  What to do if it cannot be, for the message: `name another database with --db`.
/// @throws UsageError if the database holds another campaign, naming what differs, or more runs
///         than wanted.
void extend_to(Store& store, const Campaign& wanted, const std::filesystem::path& database,
               std::string_view remedy);

/// The database for a campaign, a new one, or the one that exists after extend_to(); and the
/// campaign with as many runs as are to be computed next, see horizon_of().
/// @throws UsageError as extend_to() does, or if there is a stop rule and quantities are read from
///         tables, which have an end of their own; StoreError if it cannot be used.
[[nodiscard]] ServedCampaign open_or_create(
    const Campaign& wanted, const StopPlan& plan, const std::filesystem::path& database,
    std::string_view remedy = "name another database with --db");

}  // namespace proofmass::coordinator
