#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include "core/campaign/campaign.hpp"

namespace proofmass {

/// The values of a run's accepted draw, those that its simulation begins with; empty if all draws
/// were rejected. A pure function, some 11 µs.
/// @pre The run is one of the campaign's.
[[nodiscard]] std::optional<DrawnValues> accepted_values(const Campaign& campaign, RunIndex run);

/// Unit of a drawn quantity, for people: `rad`, `m`, `s²/m`, `m/s²`, `rad/s²` or `1`.
/// @param quantity  Index into drawn_names().
[[nodiscard]] std::string_view drawn_unit(std::size_t quantity);

}  // namespace proofmass
