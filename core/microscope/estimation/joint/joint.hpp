#pragma once

#include <vector>

#include "core/microscope/estimation/methods.hpp"

namespace proofmass {

/// Estimates all parameters at once from all informative lines of all sessions: weighted least
/// squares by Gauss and Newton's iteration, with nuisances that have priors. README.md derives the
/// model of a line, the weights and the priors.
///
/// The standard errors are those of the fit: noise, and what the nuisances may be. Without noise
/// (noise.scale 0) they are those of scale 1. Its diagnostic `last_move` is the largest move of an
/// estimate in the last round, in standard errors.
[[nodiscard]] Estimation estimate_joint(const RunPhasors& records, const EstimationInput& input);

/// 2 f_orb, the line of each angular and each drag-free excitation, 2 f of what is shaken along X,
/// and f ± 2 f_orb of masses that move in opposition along Y or Z.
[[nodiscard]] RecordNeeds joint_needs(const Session& session);

/// @throws ConfigError if a session spins, or if no session has an excitation that a parameter
///         needs.
void check_joint(const std::vector<Session>& sessions);

inline constexpr EstimationMethodInfo joint_method{
    .name = "joint",
    .needs = joint_needs,
    .check = check_joint,
    .estimate = estimate_joint,
    .has_standard_errors = true,
};

}  // namespace proofmass
