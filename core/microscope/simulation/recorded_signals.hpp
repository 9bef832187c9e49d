#pragma once

#include <vector>

#include "core/campaign/recording.hpp"
#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/simulation/observer.hpp"
#include "core/microscope/simulation/sample_noise.hpp"

namespace proofmass {

/// Frames, signals and sessions of a replay of any run of a scenario, and for each session the
/// spectrum that is expected of Γ_mes,dx. Names are those of the library: frames, axis, and no
/// unit, which RecordedSignal::unit has.
/// @param noise  Of the scenario.
[[nodiscard]] Recording recording_of(const Scenario& scenario, const NoiseModel& noise);

/// Appends the values of a sample in the order of recording_of().
void append_recorded_values(const ObservedSample& sample, std::vector<double>& values);

}  // namespace proofmass
