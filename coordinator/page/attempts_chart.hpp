#pragma once

#include <string>
#include <vector>

#include "coordinator/charts/chart.hpp"
#include "coordinator/store/records.hpp"

namespace proofmass::coordinator {

/// All attempts, worker by worker, in lanes in which they do not overlap: a lane is about one of
/// the worker's threads, the newest bar first. The database knows the second in which results came,
/// so that a bar may end up to a second before. A worker's first lane has its name and its losses.
/// @param last_s  Since 1970; times are from then on, and mostly below 0.
[[nodiscard]] std::vector<TimelineLane> lanes_of(const RecentAttempts& attempts, double last_s);

/// A timeline of the newest attempts of each worker as SVG: at most half an hour and 24 lanes; how
/// many lanes are left out is said.
[[nodiscard]] std::string attempts_chart(const RecentAttempts& attempts);

}  // namespace proofmass::coordinator
