#pragma once

#include <span>
#include <vector>

#include "coordinator/bench/bench_figures.hpp"
#include "core/campaign/run_result.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"

namespace proofmass::coordinator {

/// Measures noise alone, for one run; for a set with lanes, of a full batch.
[[nodiscard]] NoiseCost measure_noise(const MicroscopeCampaign& campaign, InstructionSet set);

/// Measures the parts of a scalar step, in one session; `noise_ns` and `whole_ns` are left 0.
[[nodiscard]] StepCost measure_step_parts(const MicroscopeCampaign& campaign);

/// True if both are the same to the last bit: −0 is not 0, and a NaN is itself.
[[nodiscard]] bool agree_to_the_bit(const RunResult& a, const RunResult& b);

/// Compares results with those of the same runs that are known, in the same order, and makes those
/// of further runs known.
/// @return True if none differs.
[[nodiscard]] bool agree_with_known(std::span<const RunResult> results,
                                    std::vector<RunResult>& known);

}  // namespace proofmass::coordinator
