#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "coordinator/store/records.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

/// What a few rows of a campaign database tell.
struct CampaignPeek {
  wire::CampaignId id;
  std::string name;
  std::string created_utc;  ///< As in `2024-02-29T12:00:10Z`.
  wire::CampaignPhase phase = wire::CampaignPhase::active;
  int priority = 0;
  std::uint64_t num_runs = 0;
  std::uint64_t num_finished = 0;
  std::uint64_t num_given_up = 0;
  std::string owner;  ///< Empty if not known.
  /// The campaign is finished or cancelled, its statistics are up to date, and there is no log:
  /// everything is in this one file, and nothing remains to be done.
  bool is_at_rest = false;
};

/// How much of a file is read.
enum class PeekDepth : std::uint8_t {
  rows,   ///< A few rows.
  pages,  ///< Every page of its tables as well, which tells most damage.
};

/// Whether a file has a write-ahead log or a rollback journal that is not empty: pages that are
/// there may be missing in the file itself.
[[nodiscard]] bool has_journal(const std::filesystem::path& path);

/// Reads a few rows of a campaign database without a lock, without its log and without writing,
/// whether a coordinator has it open or not. Changes that are in the log only are not seen.
/// @throws StoreError if the file is missing, is no campaign database, is newer than this program,
/// is damaged in the part that is read, or lacks pages that are in its log only.
[[nodiscard]] CampaignPeek peek_campaign(const std::filesystem::path& path,
                                         PeekDepth depth = PeekDepth::rows);

}  // namespace proofmass::coordinator
