#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace proofmass::wire {

/// Columns of a terminal that visible text takes: none for a combining mark, two for an East Asian
/// character or a pictograph.
[[nodiscard]] std::size_t display_width(std::string_view text);

/// Visible text of at most `width` columns, the last a `…` if something is left out.
/// @pre width ≥ 1.
[[nodiscard]] std::string shortened(std::string_view text, std::size_t width);

}  // namespace proofmass::wire
