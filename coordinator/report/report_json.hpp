#pragma once

#include <span>
#include <string>

#include "coordinator/report/requirements.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// What report_text() tells, but for the stop rule, and the answers to requirements, as JSON for
/// programs: in full precision and SI units. coordinator/cli/README.md lists the keys.
/// @throws StoreError as report_text() does.
[[nodiscard]] std::string report_json(const Store& store, const Campaign& campaign,
                                      std::span<const RequirementAnswer> answers);

}  // namespace proofmass::coordinator
