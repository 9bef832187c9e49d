#pragma once

#include <filesystem>
#include <memory>
#include <string_view>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/net/authentication/rights.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// Compares a campaign's database with the campaign that is wanted, whatever its number of runs.
///
/// @param remedy  What to do if they differ, for the message: `name another database with --db`.
/// @throws UsageError if the database holds another campaign, naming what differs.
void require_same(const Store& store, const Campaign& wanted, const std::filesystem::path& database,
                  std::string_view remedy);

/// Gives a campaign's database as many runs as are wanted.
/// @pre require_same() passed.
/// @throws UsageError if the database holds more runs than wanted.
void extend_same(Store& store, const Campaign& wanted, const std::filesystem::path& database);

/// The database for a campaign, a new one, or the one that exists after require_same() and
/// extend_same(); and the campaign with as many runs as are to be computed next, see horizon_of().
/// @param asker  Owner of a new database; must be allowed to control one that exists.
/// @throws UsageError as those do, or if there is a stop rule and quantities are read from
///         tables, which have an end of their own; StoreError if it cannot be used; Error if the
///         asker may not.
[[nodiscard]] ServedCampaign open_or_create(
    const Campaign& wanted, const StopPlan& plan, const std::filesystem::path& database,
    std::string_view remedy = "name another database with --db", const Asker& asker = {});

}  // namespace proofmass::coordinator
