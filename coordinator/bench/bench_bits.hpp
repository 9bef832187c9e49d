#pragma once

#include <span>
#include <vector>

#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// True if both are the same to the last bit: −0 is not 0, and a NaN is itself.
[[nodiscard]] bool agree_to_the_bit(const RunResult& a, const RunResult& b);

/// Compares results with those of the same runs that are known, in the same order, and makes those
/// of further runs known.
/// @return True if none differs.
[[nodiscard]] bool agree_with_known(std::span<const RunResult> results,
                                    std::vector<RunResult>& known);

}  // namespace proofmass::coordinator
