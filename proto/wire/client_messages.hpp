#pragma once

#include <cstdint>

#include "proto/wire/messages.hpp"

namespace proofmass::wire {

/// What a client does with a campaign. The values are sent: never renumber.
enum class ControlAction : std::uint8_t {
  pause = 1,
  resume = 2,
  cancel = 3,
  set_priority = 4,
  retry = 5,    ///< The runs that were given up are lent again.
  archive = 6,  ///< It is no longer served; its file moves to `archived`.
};

/// Whether a campaign's runs are lent. The values are sent: never renumber.
enum class CampaignPhase : std::uint8_t {
  active = 1,
  paused = 2,
  finished = 3,   ///< Every run is stored or given up.
  cancelled = 4,  ///< Open runs are dropped; what is stored stands.
};

}  // namespace proofmass::wire
