#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

namespace proofmass::detail {

/// Most parts of a key such as `a.b.c`, and most lists and tables inside one another. A definition
/// needs three of each.
inline constexpr int nesting_max = 16;

/// The line, from 1, where a text of TOML exceeds nesting_max; nothing if it does not, or is no
/// TOML before it does.
///
/// The TOML library parses keys of any number of parts into as many tables inside one another, and
/// exhausts the stack when it destroys them.
[[nodiscard]] std::optional<std::size_t> line_of_deep_nesting(std::string_view text);

}  // namespace proofmass::detail
