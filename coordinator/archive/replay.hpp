#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/archive/resimulation.hpp"
#include "coordinator/archive/series_output.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {

/// The runs of a campaign database, to be simulated again one by one.
class Replay {
 public:
  /// @param store  Outlives this.
  /// @throws as stored_campaign(); ArchiveError `model_version = x (must be y ...)` if the model of
  /// this program is not the one that made the file, as it would compute other bits.
  explicit Replay(const Store& store);

  [[nodiscard]] const Recording& recording() const { return plan_->recording(); }

  /// @throws InvalidArgument if the campaign has no such run; ArchiveError if it has no result.
  [[nodiscard]] RunResult stored_result(RunIndex run) const;

  /// The runs with the largest |error| of any quantity beside its objective, largest first; of
  /// equal ones the first. Runs without an estimate are left out.
  /// @param count  At most; some are fewer.
  /// @throws ArchiveError if no run has an estimate or no quantity has an objective; StoreError as
  /// walk_checked() does; Interrupted.
  [[nodiscard]] std::vector<RunResult> worst_results(std::size_t count,
                                                     const IsStopped& is_stopped) const;

  /// Simulates a run again. If the result is the stored one to the bit, the files of `output`
  /// appear.
  ///
  /// @param stored  As in the file.
  /// @param output  Null if the series are not wanted.
  /// @return All differences from the stored result. If there are any, no file appears.
  /// @throws ArchiveError if the files cannot be written, or are wanted of a run without a draw, of
  /// which nothing is simulated; Interrupted. Then no file appears.
  [[nodiscard]] std::vector<ResultDifference> run(const RunResult& stored, SeriesOutput* output,
                                                  const IsStopped& is_stopped) const;

 private:
  const Store& store_;
  std::shared_ptr<const Campaign> campaign_;
  std::unique_ptr<const Plan> plan_;
};

}  // namespace proofmass::coordinator
