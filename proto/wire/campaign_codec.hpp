#pragma once

#include "core/campaign/campaign.hpp"

namespace proofmass::proto {
class Campaign;
}  // namespace proofmass::proto

namespace proofmass::wire::detail {

/// Writes all but the table columns; `message` is empty at first.
void encode_campaign(const Campaign& campaign, proto::Campaign& message);

/// @throws Error if anything is unknown, missing, repeated, not finite or against its rule.
[[nodiscard]] Campaign decode_campaign(const proto::Campaign& message);

}  // namespace proofmass::wire::detail
