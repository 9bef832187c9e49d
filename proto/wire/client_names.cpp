#include "core/error.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::wire {

std::string_view name_of(ControlAction action) {
  switch (action) {
    case ControlAction::pause:
      return "pause";
    case ControlAction::resume:
      return "resume";
    case ControlAction::cancel:
      return "cancel";
  }
  PROOFMASS_EXPECT(false);
}

std::string_view name_of(CampaignPhase phase) {
  switch (phase) {
    case CampaignPhase::active:
      return "active";
    case CampaignPhase::paused:
      return "paused";
    case CampaignPhase::finished:
      return "finished";
    case CampaignPhase::cancelled:
      return "cancelled";
  }
  PROOFMASS_EXPECT(false);
}

}  // namespace proofmass::wire
