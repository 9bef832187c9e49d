#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/archive/resimulation.hpp"
#include "coordinator/archive/series_output.hpp"
#include "coordinator/report/review.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/recording.hpp"
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

/// Samples of a session that a spectrum is computed of: 24 days at 4 Hz, 0.4 GB while it is
/// computed. A longer session has none.
inline constexpr std::size_t num_spectrum_samples_max = std::size_t{1} << 23;

/// The spectra that the model describes of a run (Recording::spectra), from a replay of it.
///
/// A decade has 24 points; each bin within two of a fitted line has a point of its own. If the
/// replay differs from the stored result there are none, and the reasons say so.
/// @throws as Replay::run() and Replay::stored_result().
[[nodiscard]] RunSpectra replayed_spectra(const Replay& replay, RunIndex run,
                                          const IsStopped& is_stopped);

/// The spectra of the run that is the farthest off. None, and the reason, where there is no such
/// run or this program cannot replay it.
/// @param store  That of the review.
/// @throws StoreError; Interrupted.
[[nodiscard]] RunSpectra worst_run_spectra(const Store& store, const Review& review,
                                           const IsStopped& is_stopped);

/// `spectrum:SESSION` for each session that has a spectrum: the names of their charts.
[[nodiscard]] std::vector<std::string> spectrum_names(const Recording& recording);

}  // namespace proofmass::coordinator
