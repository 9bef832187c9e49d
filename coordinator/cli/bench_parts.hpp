#pragma once

#include "coordinator/cli/bench_figures.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// Measures noise alone, for one run; for a set with lanes, of a full batch.
[[nodiscard]] NoiseCost measure_noise(const Campaign& campaign, InstructionSet set);

/// Measures the parts of a scalar step, in one session; `noise_ns` and `whole_ns` are left 0.
[[nodiscard]] StepCost measure_step_parts(const Campaign& campaign);

}  // namespace proofmass::coordinator
