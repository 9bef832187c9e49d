#pragma once

#include <vector>

#include "core/microscope/campaign/loop_health.hpp"
#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/estimation/method.hpp"
#include "core/microscope/session/session.hpp"
#include "core/microscope/simulation/loop_monitor.hpp"
#include "core/signal/line_weights.hpp"

namespace proofmass {

/// What is kept of the sessions of a run, in the scenario's order.
using HealthRecord = std::vector<SessionHealth>;

/// The line at f_EP in a session without excitation, with that session's own lines beside it. Where
/// the frame turns with the Earth's direction, so that f_EP is 0, the line is f_orb.
[[nodiscard]] LineFit residual_fit(const Scenario& scenario, const Session& session);

struct HealthFinding {
  LoopHealth health;
  LoopLoss loss;  ///< In the first session, in the scenario's order, that left a limit.
};

/// Compares what the sessions left with the limits of scenario.sensor and scenario.health.
///
/// @param phasors  Of the same run: the squared signals that the quadratic factors are found from.
[[nodiscard]] HealthFinding judge_health(const Scenario& scenario, const HealthRecord& record,
                                         const RunPhasors& phasors);

}  // namespace proofmass
