#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "coordinator/store/campaign_record.hpp"
#include "coordinator/table/table.hpp"

namespace proofmass::coordinator {

/// The campaigns of some files, and of the files *.db of some directories (not of those below), by
/// name within each. Files of other kinds are left out of directories; campaign databases that are
/// damaged, older or newer than this program, or may not be read, are listed with their problem.
/// Runs that are given up are not counted.
///
/// @throws ArchiveError if a place does not exist, cannot be read, or is a file of another kind.
[[nodiscard]] std::vector<CampaignRecord> list_campaigns(
    std::span<const std::filesystem::path> places);

/// A row a campaign, and a line for each that cannot be opened.
[[nodiscard]] Table listing_table(std::span<const CampaignRecord> campaigns);

/// The campaigns as JSON, complete.
[[nodiscard]] nlohmann::ordered_json listing_json(std::span<const CampaignRecord> campaigns);

}  // namespace proofmass::coordinator
