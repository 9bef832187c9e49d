#pragma once

#include <span>
#include <string>
#include <vector>

#include "coordinator/report/requirements.hpp"
#include "coordinator/report/stated_requirement.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// What report_text() tells, but for the stop rule, and the answers to requirements, as JSON for
/// programs, with the verification matrix: in full precision and SI units.
/// coordinator/cli/README.md lists the keys.
/// @param stated  Of the matrix; see matrix_requirements().
/// @throws StoreError as report_text() does; ConfigError as parse_requirement().
[[nodiscard]] std::string report_json(const Store& store, const Campaign& campaign,
                                      std::span<const RequirementAnswer> answers,
                                      std::span<const StatedRequirement> stated);

}  // namespace proofmass::coordinator
