#pragma once

#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/campaign/dispersion.hpp"

namespace proofmass {

/// Keys that a law has in a campaign file beside `law`, each named like its field of Dispersion.
[[nodiscard]] std::span<const std::string_view> keys_of(Law law);

/// A field of a Dispersion, of the type that its key has in a campaign file.
using LawField =
    std::variant<double*, std::string*, std::vector<double>*, std::vector<std::string>*>;

/// The field of one of keys_of() any law.
[[nodiscard]] LawField field_of(Dispersion& law, std::string_view key);

}  // namespace proofmass
