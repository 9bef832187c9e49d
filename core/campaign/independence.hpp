#pragma once

#include <string>

#include "core/campaign/campaign.hpp"

namespace proofmass {

/// Why the draws of a campaign are not taken for independent; empty if they are. Intervals,
/// verdicts about requirements, tests of a difference and p-values need independent draws: each
/// place that makes some asks here.
///
/// A quantity whose law is a table without `independent = true` may follow any design (Sobol'
/// points, a Latin hypercube, a grid): `dispersion.offcentring_m.x is a table that is not declared
/// independent (dispersion.offcentring_m.x.independent = true), so that the draws may be those of a
/// design`. Imported results have one key for all (campaign.independent). Runs that share a draw,
/// and those of a sampling design, are not independent of one another either.
[[nodiscard]] std::string why_not_independent(const Campaign& campaign);

/// @throws ConfigError with the reason unless the draws are independent.
void require_independent(const Campaign& campaign, const std::string& field,
                         const std::string& value);

}  // namespace proofmass
