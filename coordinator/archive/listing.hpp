#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "coordinator/table/table.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

/// A campaign database among others.
struct ListedCampaign {
  std::filesystem::path file;
  std::string problem;  ///< Why it cannot be opened; if not empty, the rest means nothing.
  std::string name = {};
  std::uint64_t seed = 0;
  std::uint64_t num_runs = 0;      ///< Wanted.
  std::uint64_t num_finished = 0;  ///< Runs with a result.
  wire::CampaignPhase phase = wire::CampaignPhase::active;
  std::string created_utc = {};
};

/// The campaigns of some files, and of the files *.db of some directories (not of those below), by
/// name within each. Files of other kinds are left out of directories; campaign databases that are
/// damaged, older or newer than this program, or may not be read, are listed with the reason.
///
/// @throws ArchiveError if a place does not exist, cannot be read, or is a file of another kind.
[[nodiscard]] std::vector<ListedCampaign> list_campaigns(
    std::span<const std::filesystem::path> places);

/// A row a campaign, and a line for each that cannot be opened.
[[nodiscard]] Table listing_table(std::span<const ListedCampaign> campaigns);

/// The campaigns as JSON, complete.
[[nodiscard]] std::string listing_json(std::span<const ListedCampaign> campaigns);

}  // namespace proofmass::coordinator
