#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/archive/verification.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {

/// What one pass over all results of a campaign database finds. Runs are ranges: memory does not
/// grow with them unless every other one is missing.
struct ResultScan {
  std::vector<RunRange> runs;  ///< Finished ones, ascending.
  ResultDigests digests;       ///< Of their results.
  std::uint64_t num_violations = 0;
  std::vector<std::string>
      violations;  ///< details_named_max at most: `run 3: num_draws = 0 (rule)`.
};

/// Reads all results and holds them against the rules of their status, and against the list of
/// those who delivered them. Both are of one state of the file if Store::read_one_state() says so.
///
/// @throws StoreError if the file cannot be read or has them in another order, Interrupted.
[[nodiscard]] ResultScan scan_results(const Store& store, const Campaign& campaign,
                                      const IsStopped& is_stopped);

// Checks of what a campaign database keeps beside the results that it follows from, and that people
// read. All that is handed over is of one state of the file.

/// Holds `statistic`, `budget_entry`, `run_warning` and `summary` against the results that the
/// summary is of. A coordinator brings them up to date when a campaign ends or is stopped: in
/// between they are of fewer results, and only what does not depend on results is checked.
[[nodiscard]] Check check_stored_statistics(const Store& store, const Campaign& campaign,
                                            const ResultScan& scan);

/// Holds `stop_check` against the results.
[[nodiscard]] Check check_stored_stop_checks(const Store& store, const Campaign& campaign,
                                             const ResultScan& scan);

/// Fails if two workers delivered different results of one run.
[[nodiscard]] Check check_contradictions(const Store& store);

}  // namespace proofmass::coordinator
