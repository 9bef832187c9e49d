#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/run_result.hpp"
#include "core/campaign/scenario.hpp"
#include "core/campaign/statistics.hpp"

namespace proofmass::coordinator {

/// What one pass over all results of a campaign file finds.
struct ResultScan {
  std::vector<RunIndex> runs;         ///< Finished ones, ascending.
  std::string digest;                 ///< Of their results.
  StatisticsAccumulator accumulator;  ///< With their results.
  std::uint64_t num_violations = 0;
  std::vector<std::string> violations;  ///< The first ones: `run 3: num_draws = 0 (rule)`.
};

/// Violations that a ResultScan names.
inline constexpr std::uint64_t violations_named_max = 10;

/// Reads all results and holds them against the rules of their status, and against the list of
/// those who delivered them. Both are of one state of the file if Store::read_one_state() says so.
///
/// @throws StoreError if the file cannot be read, Interrupted.
[[nodiscard]] ResultScan scan_results(const Store& store, const Scenario& scenario,
                                      const IsStopped& is_stopped);

}  // namespace proofmass::coordinator
