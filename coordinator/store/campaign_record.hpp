#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "proto/client.pb.h"
#include "proto/wire/messages.hpp"

namespace proofmass::coordinator {

/// Identifies the content of a file: it changes when the file is replaced or written to.
struct FileStamp {
  std::uint64_t inode = 0;
  std::int64_t size = 0;
  std::int64_t written_ns = 0;

  bool operator==(const FileStamp&) const = default;
};

/// Nothing if there is no such file.
[[nodiscard]] std::optional<FileStamp> stamp_of(const std::filesystem::path& file);

/// A campaign as it stands: as its database says, or as a coordinator serves it.
struct CampaignRecord {
  wire::CampaignId id = {};         ///< Another campaign of the same name has another one.
  std::filesystem::path file = {};  ///< Its database.
  /// Why the file cannot be opened or served for now. If not empty, only `file` is set besides.
  std::string problem = {};
  proto::CampaignStatus status = {};
  std::uint64_t seed = 0;
  std::string created_utc = {};   ///< As in `2024-02-29T12:00:10.250Z`.
  std::uint64_t num_waiting = 0;  ///< Results that were delivered and are not stored yet.
  /// The campaign is finished or cancelled, its statistics are up to date, and there is no log:
  /// everything is in this one file, and nothing remains to be done. Or this program cannot go on
  /// with it, as it has no program of its model and the file no reference digest; if it is active,
  /// the status says that it is paused.
  bool is_closed = false;
  std::optional<FileStamp> stamp = {};  ///< Of a closed file that was looked at since.
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
/// whether a coordinator has it open or not. Changes that are in the log only are not seen. The
/// numbers of finished and given-up runs are those of the last statistics.
/// @throws StoreError if the file is missing, is no campaign database, is newer than this program,
/// is damaged in the part that is read, or lacks pages that are in its log only.
[[nodiscard]] CampaignRecord peek_campaign(const std::filesystem::path& path,
                                           PeekDepth depth = PeekDepth::rows);

}  // namespace proofmass::coordinator
