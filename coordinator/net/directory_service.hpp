#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "coordinator/net/background.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/net/campaign_service.hpp"
#include "coordinator/net/prepared_campaign.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

/// The files of a directory that are not served: looks at them again every few seconds, in the
/// background, and serves those that can be by then. So a file that was locked, on a full disk or
/// damaged is served once it can be, and one that is put into the directory is served as well. The
/// closed file of a campaign that has ended is looked at when it changes: an older copy in its
/// place is served, and a file that was removed takes its campaign from the list.
class DirectoryService {
 public:
  /// What it works with; all of that outlives it.
  struct Surroundings {
    CampaignService& campaigns;
    Background& background;
    Outbox& outbox;
    const CampaignDirectory* directory;  ///< Null if there is none.
    Duration retry_after;
    CoordinatorStart start;
  };

  explicit DirectoryService(Surroundings surroundings);

  /// Serves, lists or notes what came of looking at a file.
  void take(FileOutcome outcome);

  /// Looks again if it is time. To be called some times a second.
  void review(TimePoint now);

  /// True if no file waits to be served; copies of served campaigns do not count.
  [[nodiscard]] bool is_all_served() const;
  [[nodiscard]] std::size_t num_unserved() const { return unserved_.size(); }
  /// By name, at most so many.
  [[nodiscard]] std::vector<wire::UnservedFile> unserved(std::size_t count_max) const;

 private:
  /// What came of looking at the directory.
  struct Findings {
    std::vector<EndedFile> changed;
    std::vector<FileOutcome> outcomes;
  };

  static Findings look(const CampaignDirectory& directory, KnownCampaigns known,
                       const std::vector<EndedFile>& ended, const CoordinatorStart& start);
  void unlist(const EndedFile& changed, bool is_there);
  void note(FileFailure failure);
  void forget(const std::filesystem::path& file);
  void finish(Findings findings, TimePoint now);

  Surroundings surroundings_;
  std::map<std::filesystem::path, FileFailure> unserved_;
  TimePoint looked_at_;
  bool is_looking_ = false;
};

}  // namespace proofmass::coordinator
