#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/report/missing_estimates.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// What was drawn for runs that have an estimate, and how far their estimates are off. Draws are
/// made again from the definition; no file holds them.
struct DrawnRuns {
  std::uint64_t num_with_estimate = 0;         ///< In the whole campaign database.
  std::optional<RunIndex> last_with_estimate;  ///< Empty if there is none.
  std::uint64_t num_first = 0;                 ///< Runs that are here as the first ones.
  std::vector<RunIndex> runs;                  ///< Ascending; n of them.
  MissingEstimates missing;  ///< Runs among these that are left out; all that are given up.
  /// Drawn quantities as in Model::drawn(), then the true parameters that follow from them, as in
  /// `truth_k2d_s2_m`. Units are in the names.
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;  ///< Their values, shape [names.size()][n].
  std::vector<std::vector<double>> errors;   ///< estimate − truth, SI; shape [quantities][n].
};

/// The first runs of a campaign database that have an estimate, `num_runs_max` of them at most.
/// @param campaign  The definition in the file.
/// @param also      A run that is kept in any case if it has an estimate.
/// @throws StoreError as walk_checked() does.
[[nodiscard]] DrawnRuns read_drawn_runs(const Store& store, const Campaign& campaign,
                                        std::uint64_t num_runs_max,
                                        std::optional<RunIndex> also = std::nullopt);

}  // namespace proofmass::coordinator
