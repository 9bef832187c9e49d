#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>

#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/scenario.hpp"

namespace proofmass::coordinator {

/// A campaign file that is served, and what it defines.
struct ServedCampaign {
  std::filesystem::path file;
  Store store;
  std::shared_ptr<const Campaign> definition;  ///< Shared with the dispatch and its messages.
  bool has_new_results = false;                ///< Since its statistics were computed.
};

/// What becomes of runs that crashed too many workers of the coordinator before this one.
enum class GivenUpRuns : std::uint8_t {
  keep,   ///< They stay given up, and runs that crashed once or twice stay suspect.
  retry,  ///< They are lent like all others.
};

/// What a service wants done with campaign files and does not know how to do.
class CampaignFiles {
 public:
  virtual ~CampaignFiles() = default;

  /// The file for a campaign that is not served: a new one, or one that was served before.
  /// @throws Error if there is another campaign in the file, naming what differs.
  virtual ServedCampaign open(const Campaign& wanted) = 0;

  /// Gives a served file as many runs as are wanted. Called in the writer's thread.
  ///
  /// @return The campaign as it is now.
  /// @throws Error if it is another campaign, naming what differs, or has more runs already.
  virtual std::shared_ptr<const Campaign> extend(Store& store, const Campaign& wanted) = 0;

  /// Brings a file's statistics up to its results. Called in a thread of its own, while the service
  /// goes on.
  ///
  /// @param write  Lets its argument use the file in the writer's thread.
  virtual void summarise(const std::filesystem::path& file, const Scenario& scenario,
                         const std::function<void(const std::function<void(Store&)>&)>& write) = 0;
};

}  // namespace proofmass::coordinator
