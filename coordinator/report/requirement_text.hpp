#pragma once

#include <span>
#include <string>
#include <string_view>

#include "coordinator/report/missing_estimates.hpp"
#include "coordinator/store/store.hpp"
#include "core/statistics/requirement.hpp"

namespace proofmass::coordinator {

/// A requirement as somebody wrote it, and what the results of a campaign say about it.
struct RequirementAnswer {
  std::string text;
  Requirement requirement;
  RequirementCheck check;
  MissingEstimates missing;  ///< The exceedances for want of an estimate.
};

/// Holds requirements against the results in a campaign file; runs without an estimate, and those
/// that were given up, count as exceedances.
///
/// @param objectives  Those of the campaign's scenario.
/// @param texts       See parse_requirement().
/// @throws ConfigError if one cannot be read.
[[nodiscard]] std::vector<RequirementAnswer> check_requirements(const Store& store,
                                                                std::span<const double> objectives,
                                                                std::span<const std::string> texts);

/// Answer, the bound by which it was decided, the tolerance bound, and the draws it takes; lines of
/// at most 80 characters unless the requirement is longer.
[[nodiscard]] std::string requirement_text(const RequirementAnswer& answer);

}  // namespace proofmass::coordinator
