#pragma once

#include <cstdint>

#include "core/microscope/simulation/run.hpp"

namespace proofmass::test {

/// A result that costs nothing: numbers without meaning, the same wherever the run is computed.
[[nodiscard]] RunResult null_result(std::uint64_t seed, RunIndex run);

}  // namespace proofmass::test
