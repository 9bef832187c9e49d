#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "core/microscope/campaign/microscope_campaign.hpp"

namespace proofmass {

/// Every key of a campaign with its value, in the order of canonical_definition(), which says the
/// same as one text. The rows of data files are not in it.
[[nodiscard]] std::vector<DefinitionItem> definition_items(const MicroscopeCampaign& campaign);

}  // namespace proofmass
