#pragma once

#include <memory>

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

}  // namespace proofmass
