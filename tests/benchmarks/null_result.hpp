#pragma once

#include <cstdint>

#include "core/campaign/campaign.hpp"
#include "core/microscope/simulation/run.hpp"

namespace proofmass::test {

/// A result that costs nothing: numbers without meaning, the same wherever the run is computed.
[[nodiscard]] RunResult null_result(std::uint64_t seed, RunIndex run);

/// The same of a campaign, after the run's own draw, as a coordinator may look at that. Of a
/// campaign with tables, which a worker does not have, it costs nothing.
[[nodiscard]] RunResult null_result(const Campaign& campaign, RunIndex run);

}  // namespace proofmass::test
