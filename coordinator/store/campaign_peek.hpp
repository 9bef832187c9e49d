#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "coordinator/store/records.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

/// What a campaign database says about itself at a glance.
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
  /// The campaign is finished or cancelled, its statistics are those of its results, and no
  /// coordinator left a log: everything is in this one file, and nothing remains to be done.
  bool is_at_rest = false;
};

/// How much of a file is read.
enum class PeekDepth : std::uint8_t {
  rows,   ///< A few rows.
  pages,  ///< Every page of its tables as well, which tells most damage.
};

/// Whether a file has a write-ahead log or a rollback journal that is not empty: it may lack pages
/// that stand there.
[[nodiscard]] bool has_journal(const std::filesystem::path& path);

/// Reads a few rows of a campaign database without opening it for anybody else to notice: no lock,
/// no log, no write, whether a coordinator has it or not. What stands in the log of a file that is
/// being written is not seen.
/// @throws StoreError if it is missing, no campaign database, newer than this program or damaged
/// where it is looked at; also if it lacks pages that stand in its log.
[[nodiscard]] CampaignPeek peek_campaign(const std::filesystem::path& path,
                                         PeekDepth depth = PeekDepth::rows);

}  // namespace proofmass::coordinator
