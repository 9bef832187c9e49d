#pragma once

#include <compare>
#include <cstdint>

#include "proto/wire/messages.hpp"

namespace proofmass::coordinator {

using wire::Attempt;
using wire::CampaignId;
using wire::LossReason;
using wire::SessionId;
using wire::WorkerId;

/// Number of a lease, unique for a coordinator's lifetime, from 1. Known to the dispatch alone.
struct LeaseId {
  std::uint64_t value = 0;
  auto operator<=>(const LeaseId&) const = default;
};

}  // namespace proofmass::coordinator
