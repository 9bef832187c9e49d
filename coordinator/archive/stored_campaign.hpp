#pragma once

#include <filesystem>
#include <memory>

#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// True if the first bytes of a file say that it is a campaign database, whole or damaged; false if
/// it cannot be read or is a directory, pipe or device. Opens no database.
[[nodiscard]] bool has_campaign_mark(const std::filesystem::path& file);

/// True if it has the mark, or is a file that this user may not read.
[[nodiscard]] bool may_be_campaign(const std::filesystem::path& file);

/// The campaign that a campaign database holds.
/// @throws DefinitionError if its definition is not one or another one's, StoreError if it cannot
/// be read or is not the one that was stored, see check_definition_digest().
[[nodiscard]] std::shared_ptr<const Campaign> stored_campaign(const Store& store);

/// The campaign of a definition that may have been changed, for callers that look for changes.
[[nodiscard]] std::shared_ptr<const Campaign> stored_campaign_unchecked(const Store& store);

}  // namespace proofmass::coordinator
