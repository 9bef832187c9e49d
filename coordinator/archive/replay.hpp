#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/report/review.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/recording.hpp"
#include "core/campaign/run_result.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {

/// The runs that are simulated again for a fraction of all: spread evenly, at least one, always the
/// same ones.
/// @param runs      Ascending.
/// @param fraction  In [0, 1].
[[nodiscard]] std::vector<RunIndex> chosen_runs(std::span<const RunRange> runs, double fraction);

/// What differs between a stored result and the one that its run has.
struct ResultDifference {
  RunIndex run;
  std::string column;    ///< Of the table `run_result`.
  std::string stored;    ///< Shortest text that reads back to the same bits.
  std::string computed;  ///< As `stored`, of the run simulated again.
};

/// Every column that differs in a bit that means something; if the status does, that one alone.
/// @param schema  Of the campaign of both.
[[nodiscard]] std::vector<ResultDifference> differences_of(const RunResult& stored,
                                                           const RunResult& computed,
                                                           const ResultSchema& schema);

/// Simulates the runs of some results again, with the fastest kernel of this processor.
///
/// @param stored       Of the campaign; a run of theirs has all table values that it needs.
/// @param num_threads  That simulate; at least 1. The result does not depend on it.
/// @return All differences, in the order of the results.
/// @throws Interrupted.
[[nodiscard]] std::vector<ResultDifference> simulate_again(const Campaign& campaign,
                                                           std::span<const RunResult> stored,
                                                           std::size_t num_threads,
                                                           const HeedStop& heed_stop);

/// What drawing all runs of a file again finds.
struct Redraw {
  std::uint64_t num_drawn = 0;      ///< Runs that have a draw.
  std::uint64_t num_different = 0;  ///< Runs whose stored draw is another one.
  /// The first ones by run: `run 3: truth_offset_m = 1 (must be 2)`.
  std::vector<std::string> differences;
};

/// Draws the instrument of each run again and compares its true parameters and the number of draws
/// with those that are stored, to the last bit; some 11 µs a run and thread. Runs without a draw
/// are left out: to find none takes a thousand draws. Memory does not grow with the runs.
///
/// @param campaign  The definition in the file.
/// @throws StoreError if the file cannot be read, Interrupted.
[[nodiscard]] Redraw redraw_runs(const Store& store, const Campaign& campaign,
                                 std::size_t num_threads, const HeedStop& heed_stop);

/// What of a recording goes to files: all of it, or some sessions and groups of signals.
class SignalSelection {
 public:
  /// A group, and where its signals are among the values of a sample.
  struct Group {
    const SignalGroup* info;
    std::size_t first_value;
  };

  /// @param recording         Outlives this.
  /// @param sessions, groups  Names; none for all.
  /// @throws InvalidArgument `session = third (must be one of first, second)`.
  SignalSelection(const Recording& recording, std::span<const std::string> sessions,
                  std::span<const std::string> groups);

  [[nodiscard]] const Recording& recording() const { return *recording_; }
  /// @param session  Index in Recording::sessions.
  [[nodiscard]] bool has_session(std::size_t session) const { return has_session_[session]; }
  /// In the order of the recording.
  [[nodiscard]] const std::vector<Group>& groups() const { return groups_; }

 private:
  const Recording* recording_;
  std::vector<bool> has_session_;
  std::vector<Group> groups_;
};

/// What files with time series say of the run that these are of.
struct SeriesOrigin {
  const Store& store;
  RunResult result;             ///< The stored one.
  std::string program_version;  ///< Of this program.
};

/// Files with the time series of one run.
class SeriesOutput {
 public:
  virtual ~SeriesOutput() = default;

  /// Takes the samples of SampleSink. What is not selected is left out.
  /// @throws ArchiveError `output = path (cannot be written: why)`; so does finish().
  virtual void add(const RecordedSample& sample) = 0;
  /// Gives the files their names. Without it none appears.
  virtual void finish() = 0;

 protected:
  SeriesOutput() = default;
  SeriesOutput(const SeriesOutput&) = delete;
  SeriesOutput& operator=(const SeriesOutput&) = delete;
};

// Both replace files of the same name; README.md describes the formats. Memory does not grow with
// the samples.

/// One HDF5 file: a group a session, in it a compound dataset for each group of signals.
/// @param selection  Outlives the output.
[[nodiscard]] std::unique_ptr<SeriesOutput> hdf5_series(const std::filesystem::path& file,
                                                        const SeriesOrigin& origin,
                                                        const SignalSelection& selection);

/// A CSV file for each session, see csv_series_file().
/// @param directory  Exists.
/// @param selection  Outlives the output.
[[nodiscard]] std::unique_ptr<SeriesOutput> csv_series(const std::filesystem::path& directory,
                                                       RunIndex run,
                                                       const SignalSelection& selection);

/// `DIRECTORY/run42_SESSION.csv`.
[[nodiscard]] std::filesystem::path csv_series_file(const std::filesystem::path& directory,
                                                    RunIndex run, const RecordedSession& session);

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
                                                     const HeedStop& heed_stop) const;

  /// Simulates a run again. If the result is the stored one to the bit, the files of `output`
  /// appear.
  ///
  /// @param stored  As in the file.
  /// @param output  Null if the series are not wanted.
  /// @return All differences from the stored result. If there are any, no file appears.
  /// @throws ArchiveError if the files cannot be written, or are wanted of a run without a draw, of
  /// which nothing is simulated; Interrupted. Then no file appears.
  [[nodiscard]] std::vector<ResultDifference> run(const RunResult& stored, SeriesOutput* output,
                                                  const HeedStop& heed_stop) const;

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
                                          const HeedStop& heed_stop);

/// The spectra of the run that is the farthest off; nothing of a model of a program, which
/// describes none. None, and the reason, where there is no such run or this program cannot replay
/// it.
/// @param store  That of the review.
/// @throws StoreError; Interrupted.
[[nodiscard]] std::optional<RunSpectra> worst_run_spectra(const Store& store, const Review& review,
                                                          const HeedStop& heed_stop);

/// `spectrum:SESSION` for each session that has a spectrum: the names of their charts.
[[nodiscard]] std::vector<std::string> spectrum_names(const Recording& recording);

}  // namespace proofmass::coordinator
