#pragma once

#include <string>
#include <string_view>

#include "coordinator/archive/comparison.hpp"

namespace proofmass::coordinator {

/// A comparison for people. Lines have at most 80 characters but for values of a definition that
/// are longer.
/// @param first, second  What the campaigns are called; the text calls them A and B.
[[nodiscard]] std::string comparison_text(const CampaignComparison& comparison,
                                          std::string_view first, std::string_view second);

/// A comparison of two campaigns as JSON, complete and in SI units.
[[nodiscard]] std::string comparison_json(const CampaignComparison& comparison,
                                          std::string_view first, std::string_view second);

}  // namespace proofmass::coordinator
