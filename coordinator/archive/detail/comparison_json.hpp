#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

#include "coordinator/archive/comparison.hpp"

namespace proofmass::coordinator::detail {

/// A comparison of two campaigns as an object, see comparison_json().
[[nodiscard]] nlohmann::ordered_json comparison_object(const CampaignComparison& comparison,
                                                       std::string_view first,
                                                       std::string_view second);

}  // namespace proofmass::coordinator::detail
