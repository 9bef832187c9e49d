#pragma once

#include <cstdint>
#include <span>

#include "core/campaign/identifiers.hpp"

namespace proofmass {

/// @pre No run is in two of the ranges.
[[nodiscard]] constexpr std::uint64_t num_runs_in(std::span<const RunRange> ranges) {
  std::uint64_t num_runs = 0;
  for (const RunRange& range : ranges) num_runs += range.count;
  return num_runs;
}

}  // namespace proofmass
