#pragma once

#include "coordinator/bench/bench_figures.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"

namespace proofmass::coordinator {

/// Measures noise alone, for one run; for a set with lanes, of a full batch.
[[nodiscard]] NoiseCost measure_noise(const MicroscopeCampaign& campaign, InstructionSet set);

/// Measures the parts of a scalar step, in one session; `noise_ns` and `whole_ns` are left 0.
[[nodiscard]] StepCost measure_step_parts(const MicroscopeCampaign& campaign);

}  // namespace proofmass::coordinator
