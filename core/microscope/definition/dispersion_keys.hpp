#pragma once

#include <span>
#include <string>
#include <string_view>

#include "core/microscope/campaign/drawn_quantities.hpp"

namespace proofmass::detail {

/// Keys that a law has in a campaign file beside `law`, each named like its field of Dispersion.
[[nodiscard]] std::span<const std::string_view> keys_of(Law law);

[[nodiscard]] std::string_view name_of(Law law);

/// The field of a key, null if the key has a text.
[[nodiscard]] double* number_at(Dispersion& dispersion, std::string_view key);
/// The field of a key, null if the key has a number.
[[nodiscard]] std::string* text_at(Dispersion& dispersion, std::string_view key);

}  // namespace proofmass::detail
