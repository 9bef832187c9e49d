#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "core/campaign/campaign.hpp"

namespace proofmass {

/// A value of a campaign file: a whole number, another number, or a text. A list is a text too, as
/// it stands in the file.
using DefinitionValue = std::variant<std::int64_t, double, std::string>;

struct DefinitionItem {
  std::string key;  ///< `estimation.transient_s`, `session[3].excitations[0].axis`,
                    ///< `dispersion.offcentring_m.x.law`.
  DefinitionValue value;
};

/// Every key of a campaign with its value, in the order of canonical_definition(), which says the
/// same as one text. The rows of data files are not in it.
[[nodiscard]] std::vector<DefinitionItem> definition_items(const Campaign& campaign);

}  // namespace proofmass
