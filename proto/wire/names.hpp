#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/campaign/name.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::proto {
class CampaignStatus;
enum CampaignPhase : int;
enum ControlAction : int;
enum FactoryPhase : int;
}  // namespace proofmass::proto

namespace proofmass::wire {

using proofmass::is_name;

/// Whether a campaign's runs are lent. The values are sent: never renumber.
enum class CampaignPhase : std::uint8_t {
  active = 1,
  paused = 2,
  finished = 3,   ///< Every run is stored or given up.
  cancelled = 4,  ///< Open runs are dropped; what is stored stands.
};

/// The text with every character that a name may not have replaced by `-`, or `x` in the first
/// place, cut to 128; `unnamed` if nothing is left.
[[nodiscard]] std::string name_from(std::string_view text);

[[nodiscard]] CampaignPhase phase_of(const proto::CampaignStatus& campaign);
[[nodiscard]] proto::CampaignPhase message_value(CampaignPhase phase);

/// True if most runs of the campaign were given up: then it is no success that it is finished.
[[nodiscard]] bool has_failed(const proto::CampaignStatus& campaign);

/// Names of values for people, logs, JSON and the database: `pause`, `active`, `out_of_memory`.
[[nodiscard]] std::string_view name_of(proto::ControlAction action);
[[nodiscard]] std::string_view name_of(CampaignPhase phase);
[[nodiscard]] std::string_view name_of(proto::FactoryPhase phase);
/// The phase, or `failed` if the campaign is finished and most of its runs were given up.
[[nodiscard]] std::string_view phase_name(const proto::CampaignStatus& campaign);
[[nodiscard]] std::string_view name_of(LossReason reason);

}  // namespace proofmass::wire
