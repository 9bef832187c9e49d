#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// What one pass over all results of a campaign file finds.
struct ResultScan {
  std::vector<RunIndex> runs;  ///< Finished ones, ascending.
  std::string digest;          ///< Of their results.
  std::uint64_t num_violations = 0;
  std::vector<std::string> violations;  ///< The first ones: `run 3: num_draws = 0 (rule)`.
};

/// Violations that a ResultScan names.
inline constexpr std::uint64_t violations_named_max = 10;

/// Reads all results and holds them against the rules of their status, and against the list of
/// those who delivered them.
///
/// @param num_rounds_max  Estimation rounds that the campaign allows.
/// @throws StoreError if the file cannot be read, Interrupted.
[[nodiscard]] ResultScan scan_results(const Store& store, std::int64_t num_rounds_max,
                                      const IsStopped& is_stopped);

}  // namespace proofmass::coordinator
