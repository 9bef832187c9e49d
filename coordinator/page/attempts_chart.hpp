#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "coordinator/store/campaign_history.hpp"

namespace proofmass::coordinator {

/// When runs were computed. The database knows the second in which their results came.
struct PlacedAttempt {
  const ComputedRuns* computed = nullptr;  ///< Borrowed.
  double end_s = 0.0;                      ///< Since 1970; up to a second before the results came.

  [[nodiscard]] double begin_s() const { return end_s - computed->compute_s; }
};

/// Attempts of a worker that do not overlap: about those of one of its threads.
struct AttemptLane {
  std::uint64_t worker_key = 0;
  std::size_t number = 0;               ///< Of the worker's lanes, from 0.
  std::vector<PlacedAttempt> attempts;  ///< The newest first.
};

/// The lanes of all attempts, by worker and number. They borrow from the attempts.
[[nodiscard]] std::vector<AttemptLane> lanes_of(const RecentAttempts& attempts);

/// A timeline of the newest attempts of each worker as SVG: at most half an hour and 24 lanes; how
/// many lanes are left out is said.
[[nodiscard]] std::string attempts_chart(const RecentAttempts& attempts);

}  // namespace proofmass::coordinator
