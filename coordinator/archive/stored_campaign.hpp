#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <vector>

#include "coordinator/store/campaign_record.hpp"
#include "coordinator/store/store.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// True if the first bytes of a file say that it is a campaign database, whole or damaged; false if
/// it cannot be read or is a directory, pipe or device. Opens no database.
[[nodiscard]] bool has_campaign_mark(const std::filesystem::path& file);

/// @throws ArchiveError unless the file is there and has the mark, or this user may not read it.
void require_campaign_file(const std::filesystem::path& file);

/// The files *.db of a directory, not of those below it, by name.
/// @throws ArchiveError if it cannot be read.
[[nodiscard]] std::vector<std::filesystem::path> databases_in(
    const std::filesystem::path& directory);

/// The campaign that a campaign database holds.
/// @throws DefinitionError if its definition is not one or another one's, StoreError if it cannot
/// be read or is not the one that was stored, see check_definition_digest().
[[nodiscard]] std::shared_ptr<const Campaign> stored_campaign(const Store& store);

/// The campaigns of some files, and of the files *.db of some directories (not of those below), by
/// name within each. Files of other kinds are left out of directories; campaign databases that are
/// damaged, older or newer than this program, or may not be read, are listed with their problem.
/// Runs that are given up are not counted.
///
/// @throws ArchiveError if a place does not exist, cannot be read, or is a file of another kind.
[[nodiscard]] std::vector<CampaignRecord> list_campaigns(
    std::span<const std::filesystem::path> places);

/// A row a campaign, whose file is named as its place was, and a line for each that cannot be
/// opened.
[[nodiscard]] Table listing_table(std::span<const CampaignRecord> campaigns);

/// The campaigns as JSON, complete.
[[nodiscard]] nlohmann::ordered_json listing_json(std::span<const CampaignRecord> campaigns);

}  // namespace proofmass::coordinator
