#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace proofmass::detail {

/// Halves the distance between a number for which something holds and one for which it does not,
/// either of which may be the larger one, until they are neighbours.
/// @return The last one for which it holds.
template <typename Holds>
[[nodiscard]] std::uint64_t last_that_holds(std::uint64_t holds, std::uint64_t fails,
                                            const Holds& does_hold) {
  while (std::max(holds, fails) - std::min(holds, fails) > 1) {
    const std::uint64_t middle = std::midpoint(std::min(holds, fails), std::max(holds, fails));
    (does_hold(middle) ? holds : fails) = middle;
  }
  return holds;
}

}  // namespace proofmass::detail
