#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <vector>

#include "core/campaign/plan_study.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"

namespace proofmass {

/// What the sessions of a campaign find out under the method `joint`, whichever method the campaign
/// has; the parts are its sessions. README.md explains how.
///
/// @pre campaign.validate() passed.
/// @throws ConfigError if `joint` cannot use the sessions, or naming the parameters that they do
/// not
///         determine; Error if no instrument is accepted, or its lines are not finite.
[[nodiscard]] std::unique_ptr<PlanStudy> study_plan(const MicroscopeCampaign& campaign);

/// Whether there is noise, and `joint` can use the sessions.
[[nodiscard]] bool can_study_plan(const MicroscopeCampaign& campaign);

/// The unknowns that a normal matrix leaves open, alone or in combination with others: those with a
/// component above 0.1 in its null space. README.md derives the criterion.
///
/// @param information  Symmetric, without negative eigenvalues, finite; shape [n, n], n ≥ 1. The
///                     units of the unknowns do not matter.
/// @return Indices, ascending. Never empty: a matrix without a null space is taken to have that of
///         its smallest eigenvalue, so that a caller whose decomposition failed is told why.
[[nodiscard]] std::vector<std::size_t> undetermined_by(const Eigen::MatrixXd& information);

}  // namespace proofmass
