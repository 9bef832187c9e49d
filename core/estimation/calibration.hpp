#pragma once

#include <array>
#include <cstdint>

#include "core/campaign/parameter.hpp"
#include "core/campaign/scenario.hpp"
#include "core/estimation/signals.hpp"
#include "core/session/session.hpp"

namespace proofmass {

/// Phasors of the session for each target.
using CalibrationRecord = std::array<SessionPhasors, num_session_targets>;

struct CalibrationResult {
  ParameterArray estimate{};  ///< SI.
  std::uint32_t num_rounds = 0;
  bool converged = false;  ///< False if estimates still moved in the last allowed round.
};

/// Estimates the ten parameters session by session as [Hardy2013] sections 4.2 and 5.2: in the
/// first round each from its own session alone, in every later one after subtracting from Γ_mes,dx
/// what the round before says of the others, until no estimate moves by more than
/// config.convergence of its objective.
///
/// What is subtracted depends on config.correction:
/// - `first_order`: every term of eq:Gamma-mesdx that is linear in one estimated parameter;
/// - `hardy2013`: the same and in each Δ session the product that the paper's Γ_calib,2 has for Δx,
///   or its counterpart (core/estimation/README.md says which terms the paper prints);
/// - `second_order`: all products of two instrument errors.
[[nodiscard]] CalibrationResult calibrate_hardy2013(const CalibrationRecord& record,
                                                    const EstimationConfig& config,
                                                    const ParameterArray& objectives);

}  // namespace proofmass
