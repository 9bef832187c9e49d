#pragma once

#include "coordinator/archive/result_scan.hpp"
#include "coordinator/archive/verification.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

// Checks of what a campaign file keeps beside the results that it follows from, and that people
// read. All that is handed over is of one state of the file.

/// Holds `statistic`, `budget_entry` and `summary` against the results that the summary is of. A
/// coordinator brings them up to date when a campaign ends or is stopped: in between they are of
/// fewer results, and only what does not depend on results is checked.
[[nodiscard]] Check check_stored_statistics(const Store& store, const Campaign& campaign,
                                            const ResultScan& scan);

/// Holds `stop_check` against the results.
[[nodiscard]] Check check_stored_stop_checks(const Store& store, const Campaign& campaign,
                                             const ResultScan& scan);

/// Fails if two workers delivered different results of one run.
[[nodiscard]] Check check_contradictions(const Store& store);

}  // namespace proofmass::coordinator
