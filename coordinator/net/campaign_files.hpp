#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/authentication/rights.hpp"
#include "coordinator/store/campaign_record.hpp"
#include "coordinator/store/records.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/runs.hpp"
#include "core/statistics/stop_rule.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

/// A campaign database that is served, and what it defines.
struct ServedCampaign {
  std::filesystem::path file;
  Store store;
  std::shared_ptr<const Campaign> definition;  ///< Shared with the dispatch and its messages.
  std::vector<RunRange> elsewhere = {};        ///< Runs that are not to be computed here.
  bool is_new = false;                         ///< Made just now, with nothing in it yet.
};

/// Removes a database that was made for nothing, if it can be. @pre It is closed.
inline void remove_made(const std::filesystem::path& file) {
  std::error_code ignored;
  std::filesystem::remove(file, ignored);
  (void)wire::synchronise_directory_of(file);
}

/// The number of runs that a campaign is to have for now. With a stop rule it is the next at which
/// the rule is checked, so that the stopping point does not depend on workers and their order.
///
/// @param num_runs_wanted  Asked for; with a stop rule, at most.
/// @param num_runs_now     In the file; 0 for a new one.
[[nodiscard]] inline std::uint64_t horizon_of(const StopPlan& plan, std::uint64_t num_runs_wanted,
                                              std::uint64_t num_runs_now) {
  if (plan.stop_rule.empty() || num_runs_wanted < num_runs_now) return num_runs_wanted;
  const std::uint64_t num_before = num_runs_now == 0 ? 0 : num_runs_now - 1;
  return std::min(next_stop_check(num_before), num_runs_wanted);
}

/// How runs are treated that crashed workers of an earlier coordinator.
enum class GivenUpRuns : std::uint8_t {
  keep,   ///< They stay given up, and runs that crashed once or twice stay suspect.
  retry,  ///< They are lent like all others.
};

/// What a service has to have done with campaign databases. The program that runs the service
/// implements it: `proofmass run` for one file, a coordinator for its directory.
class CampaignFiles {
 public:
  virtual ~CampaignFiles() = default;

  /// The file for a campaign that is not open: the one from which it was served before, or else one
  /// of its name, a new one perhaps. With a stop rule it has as many runs as the rule is to be
  /// checked with next. Called in a background thread.
  ///
  /// @param asker  Its name becomes the owner of a new file.
  /// @param known  The file if it was served before, whatever it is called.
  /// @throws Error if there is another campaign in the file, naming what differs, or one that the
  ///         asker may not control; StoreError if a known file is gone.
  virtual ServedCampaign open(const Campaign& wanted, const StopPlan& plan, const Asker& asker,
                              const std::optional<std::filesystem::path>& known) = 0;

  /// Compares a served file with the campaign that is wanted, whatever its number of runs. Called
  /// in a background thread, before extend().
  /// @throws Error if it is another campaign, naming what differs.
  virtual void require_same(const std::filesystem::path& file, const Campaign& wanted) {
    (void)file;
    (void)wanted;
  }

  /// Gives a served file as many runs as are wanted. Called in the writer's thread.
  ///
  /// @return The campaign as it is now.
  /// @throws Error if it is another campaign, naming what differs, or has more runs already.
  virtual std::shared_ptr<const Campaign> extend(Store& store, const Campaign& wanted) = 0;

  /// Brings a file's statistics up to its results and, if all are there, checks its stop rule.
  /// Called in a thread of its own, while the service goes on.
  ///
  /// @param write  Lets its argument use the file in the writer's thread.
  /// @return The number of runs that the rule asks for next; empty if there are enough.
  virtual std::optional<std::uint64_t> summarise(
      const std::filesystem::path& file, const Campaign& campaign,
      const std::function<void(const std::function<void(Store&)>&)>& write) = 0;
};

/// A directory all of whose campaign databases are to be served. Called in a background thread.
class CampaignDirectory {
 public:
  virtual ~CampaignDirectory() = default;

  /// The campaign databases that are there now, by name.
  /// @throws Error if the directory cannot be read.
  [[nodiscard]] virtual std::vector<std::filesystem::path> list() const = 0;

  /// Opens one of them.
  /// @throws Error, std::exception if it cannot be served.
  [[nodiscard]] virtual ServedCampaign load(const std::filesystem::path& file) const = 0;

  /// Moves one of them, which is closed, to where it is not served.
  /// @return Where it is now.
  /// @throws Error if that is impossible or a file is there already.
  [[nodiscard]] virtual std::filesystem::path archive(const std::filesystem::path& file) const = 0;

  /// True if a campaign of this name was moved there, `archived/NAME.db`.
  [[nodiscard]] virtual bool has_archived(const std::string& campaign) const = 0;
};

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
  std::uint64_t num_failures = 0;  ///< Finished runs without an estimate.
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
/// @param num_reserved  Descriptors that are not for campaigns, see require_room_for_campaign().
/// @throws Error if the directory cannot be read.
[[nodiscard]] std::vector<FileLook> look_at_all(const CampaignDirectory& directory,
                                                KnownCampaigns& known,
                                                const CoordinatorStart& start,
                                                std::uint64_t num_reserved);

/// A coordinator that starts now in this process.
/// @param version  Of the program, for people.
[[nodiscard]] CoordinatorStart coordinator_start(const std::string& version);

/// Reads what must be known of the campaigns that are handed over, which come first, and of those
/// in the directory. The sockets are not there yet.
/// @param directory     Null if there is none.
/// @param num_reserved  See ServiceConfig::num_descriptors_reserved.
/// @throws Error, StoreError if a campaign that is handed over cannot be served, or the directory
///         cannot be read.
[[nodiscard]] std::vector<FileLook> looks_at_beginning(std::vector<ServedCampaign> campaigns,
                                                       GivenUpRuns given_up,
                                                       const CampaignDirectory* directory,
                                                       const CoordinatorStart& start,
                                                       std::uint64_t num_reserved);

/// Workers that may come back to any of the campaigns.
[[nodiscard]] std::set<SessionId> sessions_of(const std::vector<FileLook>& looks);

/// Bytes that the tables of a campaign take.
[[nodiscard]] std::uint64_t definition_size(const Campaign& campaign);

}  // namespace proofmass::coordinator
