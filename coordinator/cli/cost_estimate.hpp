#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// The campaign's first batch, which is a full one unless the campaign has fewer runs.
struct FirstBatch {
  /// Processor time on this machine, extrapolated from the steps that the first half second takes.
  /// All steps of a run take about the same time. Of a model program, the time that passes, with
  /// the first run for all others if it takes as long.
  double time_s = 0.0;
  std::vector<RunResult> results;  ///< Empty if half a second was not enough for all steps.
};

/// @param plan  The campaign's.
[[nodiscard]] FirstBatch try_first_batch(const Campaign& campaign, const Plan& plan);

/// What it costs to run campaigns on this machine.
struct CostEstimate {
  double one_core_s = 0.0;   ///< On one core.
  double all_cores_s = 0.0;  ///< On all of them, with `proofmass run`.
  double disk_mb = 0.0;      ///< Of the databases.

  CostEstimate& operator+=(const CostEstimate& other);
};

/// Of a campaign with so many runs, whose batches take so long. `run` gives each core one batch of
/// runs at a time. The last batch counts as a whole one, which it costs at most.
[[nodiscard]] CostEstimate estimated_cost(const Campaign& campaign, std::uint64_t num_runs,
                                          double batch_s);

/// Two lines that begin with `Time      about` and `Disk      about`.
[[nodiscard]] std::string cost_text(const CostEstimate& cost);

}  // namespace proofmass::coordinator
