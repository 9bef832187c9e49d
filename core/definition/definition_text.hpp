#pragma once

#include <cstddef>
#include <optional>
#include <set>
#include <span>
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

namespace detail {

/// Shortest decimal that reads back to the same bits; valid TOML. The value is finite.
[[nodiscard]] std::string number_text(double value);

/// A TOML basic string, escaped.
[[nodiscard]] std::string quoted_text(std::string_view text);

/// `"a", "b" or "c"`.
[[nodiscard]] std::string alternatives(std::span<const std::string_view> names);

/// Most parts of a key such as `a.b.c`, and most lists and tables inside one another. A definition
/// needs three of each.
inline constexpr int nesting_max = 16;

/// The line, from 1, where a text of TOML exceeds nesting_max; nothing if it does not, or is no
/// TOML before it does.
///
/// The TOML library parses keys of any number of parts into as many tables inside one another, and
/// exhausts the stack when it destroys them.
[[nodiscard]] std::optional<std::size_t> line_of_deep_nesting(std::string_view text);

}  // namespace detail
}  // namespace proofmass
