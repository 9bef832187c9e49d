#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/net/service_snapshot.hpp"
#include "coordinator/store/records.hpp"

namespace proofmass::coordinator {

// What a service must know of a campaign database before it serves it. Reading that takes as long
// as the disk does, so it is done before the service begins or in a background thread.

/// What a look at a campaign database found.
struct FileLook {
  CampaignRecord record = {};
  bool is_copy = false;  ///< It is not served as another file of its campaign is.
  // Of a campaign that is to be served. One that has ended has neither store nor what follows.
  std::optional<Store> store = {};
  StoredCampaign stored = {};  ///< For the dispatch.
  StopPlan plan = {};
  std::uint64_t num_failures = 0;        ///< Finished runs without an estimate.
  std::vector<SessionId> sessions = {};  ///< Workers that may come back.
};

/// Finds out whether a service has a file, or the campaign of a file, already.
struct KnownCampaigns {
  std::set<std::filesystem::path> files;
  std::set<CampaignId> ids;
  std::set<std::string> names;

  void add(const CampaignRecord& campaign);
  void remove(const CampaignRecord& campaign);
};

/// Reads what the service must know, and writes down that a coordinator begins.
/// @throws StoreError, Error.
[[nodiscard]] FileLook prepare(ServedCampaign campaign, GivenUpRuns given_up,
                               const CoordinatorStart& start);

/// Looks at the files of a directory that are not known and adds their campaigns to those that are.
/// Lists them in the order in which the campaigns were made. Opens a file only if something is
/// left to do with it: a campaign that has ended costs no lock, no descriptor and no write.
/// @throws Error if the directory cannot be read.
[[nodiscard]] std::vector<FileLook> look_at_all(const CampaignDirectory& directory,
                                                KnownCampaigns& known,
                                                const CoordinatorStart& start);

/// A coordinator that starts now in this process.
/// @param version  Of the program, for people.
[[nodiscard]] CoordinatorStart coordinator_start(const std::string& version);

/// Reads what must be known of the campaigns that are handed over, which come first, and of those
/// in the directory.
/// @param directory  Null if there is none.
/// @throws Error, StoreError if a campaign that is handed over cannot be served, or the directory
///         cannot be read.
[[nodiscard]] std::vector<FileLook> looks_at_beginning(std::vector<ServedCampaign> campaigns,
                                                       GivenUpRuns given_up,
                                                       const CampaignDirectory* directory,
                                                       const CoordinatorStart& start);

/// Workers that may come back to any of the campaigns.
[[nodiscard]] std::set<SessionId> sessions_of(const std::vector<FileLook>& looks);

/// Bytes that the tables of a campaign take.
[[nodiscard]] std::uint64_t definition_size(const Campaign& campaign);

}  // namespace proofmass::coordinator
