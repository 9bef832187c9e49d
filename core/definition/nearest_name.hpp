#pragma once

#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <string_view>

namespace proofmass {

/// Fewest insertions, deletions, replacements and swaps of neighbours that turn one text into the
/// other, no part being changed twice (optimal string alignment).
[[nodiscard]] std::size_t edit_distance(std::string_view from, std::string_view to);

/// The candidate nearest to a mistyped name, or nothing if none is near: more than a third of the
/// name would have to change.
[[nodiscard]] std::optional<std::string> nearest_name(std::string_view name,
                                                      const std::set<std::string>& candidates);

}  // namespace proofmass
