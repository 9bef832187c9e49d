#pragma once

#include <span>
#include <string_view>

#include "core/campaign/dispersion.hpp"

namespace proofmass {

/// Keys that a law has in a campaign file beside `law`, each named like its field of Dispersion.
[[nodiscard]] std::span<const std::string_view> keys_of(Law law);

/// The field of a key, null unless the key has a number.
[[nodiscard]] double* number_at(Dispersion& dispersion, std::string_view key);

}  // namespace proofmass
