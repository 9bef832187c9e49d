#include "proto/wire/names.hpp"

#include <algorithm>
#include <cstddef>

#include "core/campaign/name.hpp"
#include "core/error.hpp"

namespace proofmass::wire {
namespace {

constexpr std::size_t name_length_max = 128;

}  // namespace

bool is_name(std::string_view text) {
  return text.size() <= name_length_max && has_name_form(text);
}

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

bool has_failed(const CampaignStatus& campaign) {
  return campaign.phase == CampaignPhase::finished && campaign.num_given_up > campaign.num_runs / 2;
}

std::string_view phase_name(const CampaignStatus& campaign) {
  return has_failed(campaign) ? "failed" : name_of(campaign.phase);
}

std::string_view name_of(FactoryPhase phase) {
  switch (phase) {
    case FactoryPhase::active:
      return "active";
    case FactoryPhase::waiting:
      return "waiting";
    case FactoryPhase::paused:
      return "paused";
  }
  PROOFMASS_EXPECT(false);
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
