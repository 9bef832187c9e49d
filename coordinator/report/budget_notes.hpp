#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// What a reader of a budget should know: what its level is, and ErrorBudget::note line by line.
/// @param unit  Of the level.
/// @param told  Of which runs the level is, with its value: `the runs: worst 2, mean 1`; empty if
///              no run tells it, so that the assumed one holds.
[[nodiscard]] std::vector<std::string> level_notes(const ErrorBudget& budget, std::string_view unit,
                                                   std::string_view told);

}  // namespace proofmass::coordinator
