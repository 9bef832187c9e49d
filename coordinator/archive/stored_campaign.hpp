#pragma once

#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// The campaign that a campaign file holds.
/// @throws CampaignFileError if its definition is not one or another one's, StoreError if it cannot
/// be read.
[[nodiscard]] Campaign stored_campaign(const Store& store);

}  // namespace proofmass::coordinator
