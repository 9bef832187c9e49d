#include "proto/wire/names.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "proto/client.pb.h"

namespace proofmass::wire {

std::string name_from(std::string_view text) {
  std::string name(text.substr(0, name_length_max));
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !may_be_in_name(c); }, '-');
  if (name.empty()) return "unnamed";
  if (!has_name_form(name)) name.front() = 'x';
  return name;
}

std::string_view name_of(ControlAction action) {
  switch (action) {
    case ControlAction::pause:
      return "pause";
    case ControlAction::resume:
      return "resume";
    case ControlAction::cancel:
      return "cancel";
    case ControlAction::set_priority:
      return "set-priority";
    case ControlAction::archive:
      return "archive";
    case ControlAction::retry:
      return "retry";
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

CampaignPhase phase_of(const proto::CampaignStatus& campaign) {
  return static_cast<CampaignPhase>(campaign.phase());
}

proto::CampaignPhase message_value(CampaignPhase phase) {
  return static_cast<proto::CampaignPhase>(phase);
}

bool has_failed(const proto::CampaignStatus& campaign) {
  return phase_of(campaign) == CampaignPhase::finished &&
         campaign.num_given_up() > campaign.num_runs() / 2;
}

std::string_view phase_name(const proto::CampaignStatus& campaign) {
  return has_failed(campaign) ? "failed" : name_of(phase_of(campaign));
}

std::string_view name_of(proto::FactoryPhase phase) {
  constexpr std::array<std::string_view, 3> names{"active", "waiting", "paused"};
  return names.at(static_cast<std::size_t>(phase) - 1);
}

std::string_view name_of(LossReason reason) {
  switch (reason) {
    case LossReason::silent:
      return "silent";
    case LossReason::crashed:
      return "crashed";
    case LossReason::out_of_memory:
      return "out_of_memory";
    case LossReason::hung:
      return "hung";
    case LossReason::drained:
      return "drained";
    case LossReason::walltime:
      return "walltime";
    case LossReason::preempted:
      return "preempted";
    case LossReason::retracted:
      return "retracted";
    case LossReason::never_arrived:
      return "never_arrived";
    case LossReason::protocol:
      return "protocol";
    case LossReason::failed:
      return "failed";
  }
  PROOFMASS_EXPECT(false);
}

}  // namespace proofmass::wire
