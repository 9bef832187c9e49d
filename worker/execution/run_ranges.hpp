#pragma once

#include <span>
#include <vector>

#include "core/campaign/identifiers.hpp"

namespace proofmass::worker {

/// All that a campaign may have.
inline constexpr RunRange all_runs{{0}, num_runs_max};

/// Runs in ascending order, each once, as the fewest ranges.
[[nodiscard]] std::vector<RunRange> ranges_of(std::span<const RunIndex> runs);

/// The runs of the ranges, in their order.
[[nodiscard]] std::vector<RunIndex> indices_of(std::span<const RunRange> ranges);

}  // namespace proofmass::worker
