#pragma once

#include "core/statistics/detail/phrase.hpp"
#include "core/statistics/requirement.hpp"

namespace proofmass::detail {

/// Reads a requirement from the front of a phrase.
[[nodiscard]] Requirement read_requirement(Phrase& phrase);

}  // namespace proofmass::detail
