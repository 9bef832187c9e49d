#pragma once

#include <functional>
#include <string>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/authentication/rights.hpp"
#include "coordinator/net/campaign_service.hpp"
#include "coordinator/net/client_gateway.hpp"
#include "coordinator/net/directory_service.hpp"
#include "coordinator/net/submission_service.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

/// Carries out what clients ask for, if they may ask for it.
class RequestService {
 public:
  /// What it works with; all of that outlives it.
  struct Surroundings {
    State& state;
    CampaignService& campaigns;
    SubmissionService& submissions;
    DirectoryService& directory;
    Outbox& outbox;
    std::function<TimePoint()> now;
    std::string version;  ///< Of the program.
  };

  explicit RequestService(Surroundings surroundings);

  /// Responds at once, or later if a file must be opened or made.
  /// @throws Error, std::exception with the reason if it is not carried out.
  void carry_out(Request request, const Asker& asker, Respond respond);

 private:
  /// Has a specialisation for each kind of Request.
  template <typename Content>
  void take(Content&& request, const Asker& asker, const Respond& respond) = delete;
  void control_ended(const CampaignService::Entry& campaign, wire::ControlAction action,
                     const Respond& respond);

  Surroundings surroundings_;
  TimePoint began_at_;
};

}  // namespace proofmass::coordinator
