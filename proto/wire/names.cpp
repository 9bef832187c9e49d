#include "proto/wire/names.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

#include "core/campaign/name.hpp"
#include "proto/client.pb.h"

namespace proofmass::wire {
namespace {

/// Of an enumerator, which are numbered from 1 without a gap.
template <std::size_t count>
std::string_view name_in(const std::array<std::string_view, count>& names, auto value) {
  return names.at(static_cast<std::size_t>(value) - 1);
}

}  // namespace

std::string name_from(std::string_view text) {
  std::string name(text.substr(0, name_length_max));
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !may_be_in_name(c); }, '-');
  if (name.empty()) return "unnamed";
  if (!has_name_form(name)) name.front() = 'x';
  return name;
}

std::string_view name_of(proto::ControlAction action) {
  static constexpr std::array<std::string_view, 6> names{"pause",        "resume", "cancel",
                                                         "set-priority", "retry",  "archive"};
  return name_in(names, action);
}

std::string_view name_of(CampaignPhase phase) {
  static constexpr std::array<std::string_view, 4> names{"active", "paused", "finished",
                                                         "cancelled"};
  return name_in(names, phase);
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
  static constexpr std::array<std::string_view, 3> names{"active", "waiting", "paused"};
  return name_in(names, phase);
}

std::string_view name_of(LossReason reason) {
  static constexpr std::array<std::string_view, 11> names{
      "silent",    "crashed",   "out_of_memory", "hung",     "drained", "walltime",
      "preempted", "retracted", "never_arrived", "protocol", "failed"};
  return name_in(names, reason);
}

}  // namespace proofmass::wire
