#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "coordinator/store/store.hpp"
#include "core/campaign/scenario.hpp"

namespace proofmass::coordinator {

/// Brings the statistics of a campaign file up to its results, which are those of all runs that it
/// is to have for now, and checks its stop rule with them.
///
/// @param write  Lets its argument use the file where it is written.
/// @return The number of runs that the stop rule asks for next; empty if there is none, if it is
///         reached, or if there are as many runs as there may be.
std::optional<std::uint64_t> summarise_file(
    const std::filesystem::path& file, const Scenario& scenario,
    const std::function<void(const std::function<void(Store&)>&)>& write);

/// What came of a campaign's stop rule, in two lines of at most 80 characters; empty if there is
/// none or it was not checked.
[[nodiscard]] std::string stop_text(const Store& store);

/// True if a campaign has a stop rule that was checked and not reached.
[[nodiscard]] bool is_rule_missed(const Store& store);

}  // namespace proofmass::coordinator
