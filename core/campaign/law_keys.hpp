#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/dispersion.hpp"

namespace proofmass {

/// Keys that a law has in a campaign file beside `law`, each named like its field of Dispersion.
[[nodiscard]] std::span<const std::string_view> keys_of(Law law);

/// The field of a key, null unless the key has a number.
[[nodiscard]] double* number_at(Dispersion& dispersion, std::string_view key);
/// The field of a key, null unless the key has a text.
[[nodiscard]] std::string* text_at(Dispersion& dispersion, std::string_view key);
/// The field of a key, null unless the key has a list of numbers.
[[nodiscard]] std::vector<double>* numbers_at(Dispersion& dispersion, std::string_view key);
/// The field of a key, null unless the key has a list of texts.
[[nodiscard]] std::vector<std::string>* texts_at(Dispersion& dispersion, std::string_view key);

/// `uniform`.
[[nodiscard]] std::string_view name_of(Law law);

}  // namespace proofmass
