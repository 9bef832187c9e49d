#pragma once

#include <vector>

#include "core/microscope/estimation/methods.hpp"

namespace proofmass {

/// Estimates the ten parameters session by session as [Hardy2013] sections 4.2 and 5.2: in the
/// first round each from the sessions that have it as their target, in every later one after
/// subtracting from Γ_mes,dx what the round before says of the others, until no estimate moves by
/// more than estimation.convergence of its objective.
///
/// A target that several sessions serve is their joint least-squares fit, each session weighted by
/// its length. Sessions without a target, and tests, are not used.
///
/// What is subtracted depends on estimation.correction:
/// - `first_order`: every term of eq:Gamma-mesdx that is linear in one estimated parameter;
/// - `hardy2013`: the same and in each Δ session the product that the paper's Γ_calib,2 has for Δx,
///   or its counterpart (core/microscope/estimation/README.md says which terms the paper prints);
/// - `second_order`: all products of two instrument errors.
///
/// Its standard errors are those by the noise of the sensors alone; what the error of one estimate
/// makes of another is left out.
[[nodiscard]] Estimation estimate_hardy2013(const RunPhasors& records,
                                            const EstimationInput& input);

/// The lines to be fitted, with the signals that the session's target needs.
[[nodiscard]] RecordNeeds hardy2013_needs(const Session& session);

/// @throws ConfigError if a target has no session.
void check_hardy2013(const std::vector<Session>& sessions);

inline constexpr EstimationMethodInfo hardy2013_method{
    .name = "hardy2013",
    .needs = hardy2013_needs,
    .check = check_hardy2013,
    .estimate = estimate_hardy2013,
};

}  // namespace proofmass
