#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/store/records.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

// What a service must know of a campaign database before it serves it. Reading that takes as long
// as the disk does, so it is done before the service begins or in a background thread.

/// A campaign that can be served at once.
struct PreparedCampaign {
  ServedCampaign campaign;
  StoredCampaign stored;  ///< For the dispatch.
  CampaignControl control;
  StopPlan plan;
  std::string created_utc;          ///< As in `2024-02-29T12:00:10Z`.
  std::string owner;                ///< Name of the key that submitted it; empty if not known.
  std::uint64_t num_failures = 0;   ///< Finished runs without an estimate.
  std::vector<SessionId> sessions;  ///< Workers that may come back.
};

/// Tells whether a file is still the one that it was, with the same content.
struct FileStamp {
  std::uint64_t inode = 0;
  std::int64_t size = 0;
  std::int64_t written_ns = 0;

  bool operator==(const FileStamp&) const = default;
};

/// Nothing if there is no such file.
[[nodiscard]] std::optional<FileStamp> stamp_of(const std::filesystem::path& file);

/// A finished or cancelled campaign whose file is closed and complete.
struct EndedCampaign {
  CampaignId id;
  std::filesystem::path file;
  wire::CampaignStatus status;
  std::string created_utc = {};    ///< When its file was made; empty if this service closed it.
  std::optional<FileStamp> stamp;  ///< Of the file when it was last looked at; empty until it was.
};

/// The file of such a campaign.
struct EndedFile {
  CampaignId id;
  std::filesystem::path file;
  std::string name;
  std::optional<FileStamp> stamp;
};

/// A file that cannot be served for now.
struct FileFailure {
  std::filesystem::path file;
  std::string reason;
  bool is_copy = false;  ///< Of a campaign that is served from another file.
};

using FileOutcome = std::variant<PreparedCampaign, EndedCampaign, FileFailure>;

/// What a service has already.
struct KnownCampaigns {
  std::set<std::filesystem::path> files;
  std::set<CampaignId> ids;
  std::set<std::string> names;

  void add(const FileOutcome& outcome);
  void remove(const EndedFile& ended);
};

/// Reads what the service must know, and writes down that a coordinator begins.
/// @throws StoreError, Error.
[[nodiscard]] PreparedCampaign prepare(ServedCampaign campaign, GivenUpRuns given_up,
                                       const CoordinatorStart& start);

/// Looks at the files of a directory that are not known and adds their campaigns to those that are.
/// Tells of them in the order in which the campaigns were made. Opens a file only if something is
/// left to do with it: a campaign that has ended costs no lock, no descriptor and no write.
/// @throws Error if the directory cannot be read.
[[nodiscard]] std::vector<FileOutcome> look_at_all(const CampaignDirectory& directory,
                                                   KnownCampaigns& known,
                                                   const CoordinatorStart& start);

/// What a service begins with.
struct Beginning {
  CoordinatorStart start;
  std::vector<FileOutcome> campaigns;  ///< Those that are handed over come first.
  std::set<SessionId> attached;        ///< Workers that may come back.
};

/// Reads what must be known of the campaigns that are handed over and of those in the directory.
/// @param directory  Null if there is none.
/// @param version    Of the program, for people.
/// @throws Error, StoreError if a campaign that is handed over cannot be served, or the directory
///         cannot be read.
[[nodiscard]] Beginning beginning_of(std::vector<ServedCampaign> campaigns, GivenUpRuns given_up,
                                     const CampaignDirectory* directory,
                                     const std::string& version);

/// Bytes that the tables of a campaign take.
[[nodiscard]] std::uint64_t definition_size(const Campaign& campaign);

}  // namespace proofmass::coordinator
