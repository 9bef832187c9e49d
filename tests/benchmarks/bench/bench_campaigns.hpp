#pragma once

#include <cstdint>

#include "tests/benchmarks/bench/bench_parts.hpp"

namespace proofmass::test {

/// Runs the paper's campaign with so many runs as a user does: `proofmass run` as a process of its
/// own, on all processors, into a database in a directory that is removed afterwards.
/// @throws Error if it cannot be run.
[[nodiscard]] CampaignCost measure_campaign(std::uint64_t num_runs);

}  // namespace proofmass::test
