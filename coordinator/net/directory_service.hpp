#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "coordinator/net/campaign_files.hpp"
#include "coordinator/net/campaign_service.hpp"
#include "coordinator/net/prepared_campaign.hpp"
#include "coordinator/net/service_context.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

/// The files of a directory that are not served. They are looked at again every few seconds, in the
/// background, and served as soon as possible: files that were locked, damaged or on a full disk,
/// and files that are new in the directory. The closed file of a campaign that has ended is looked
/// at when it changes: an older copy in its place is served, and if it was removed, its campaign is
/// no longer listed.
class DirectoryService {
 public:
  /// @param campaigns  Outlives this object.
  DirectoryService(const ServiceContext& context, CampaignService& campaigns);

  /// Serves or lists the campaign of a file, or notes why that is not possible.
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

  const ServiceContext& context_;
  CampaignService& campaigns_;
  std::map<std::filesystem::path, FileFailure> unserved_;
  TimePoint looked_at_;
  bool is_looking_ = false;
};

}  // namespace proofmass::coordinator
