#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/net/authentication/rights.hpp"
#include "coordinator/net/background.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/net/campaign_service.hpp"
#include "coordinator/net/client_gateway.hpp"
#include "coordinator/net/request.hpp"
#include "coordinator/store/store_writer.hpp"

namespace proofmass::coordinator {

/// Takes campaigns that clients submit: makes, opens and extends their files in the background, so
/// that the service goes on meanwhile.
class SubmissionService {
 public:
  /// What it works with; all of that outlives it.
  struct Surroundings {
    CampaignService& campaigns;
    StoreWriter& writer;
    Background& background;
    CampaignFiles* files;                ///< Null if nothing can be submitted.
    const CampaignDirectory* directory;  ///< Null if files that were closed stay closed.
    SubmissionLimits limits;
    CoordinatorStart start;
  };

  explicit SubmissionService(Surroundings surroundings);

  /// Takes a new campaign, or more runs of one that is there. Waits while the campaign is being
  /// changed, opened or closed.
  /// @throws Error if the asker may not, has submitted too much, or if too much is under way.
  void submit(const std::shared_ptr<const Submission>& request, const Asker& asker,
              Respond respond);

  /// Opens the file of a campaign that has ended and goes on with it.
  /// @param action  resume or retry.
  /// @throws Error if too much is under way.
  void reopen(const CampaignService::Entry& campaign, wire::ControlAction action, Respond respond);

  /// Takes what had to wait. To be called some times a second.
  void review();

 private:
  /// What is being opened or made in the background.
  struct UnderWay {
    std::string owner;
    std::uint64_t size = 0;
  };

  /// A submission that waits.
  struct Deferred {
    std::shared_ptr<const Submission> request;
    Asker asker;
    Respond respond;
  };

  [[nodiscard]] bool is_busy(const std::string& name) const;
  void check_limits(const std::string& owner, std::uint64_t size, bool is_new) const;
  void open_file(const std::shared_ptr<const Submission>& request, const Asker& asker,
                 const std::string& owner, Respond respond);
  void change_served(CampaignId id, const std::shared_ptr<const Submission>& request,
                     Respond respond);
  /// Opens or makes a file with `open` in the background, and serves it.
  /// @param activate  Stores what is to be different from now on, the phase at least.
  void serve_opened(const std::string& name, UnderWay under_way,
                    std::function<ServedCampaign()> open, std::function<void(Store&)> activate,
                    Respond respond);

  Surroundings surroundings_;
  CampaignService& campaigns_;
  std::map<std::string, UnderWay> under_way_;  ///< By the campaign's name.
  std::vector<Deferred> deferred_;
};

}  // namespace proofmass::coordinator
