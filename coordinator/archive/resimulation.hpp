#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// The runs that are simulated again for a fraction of all: spread evenly, at least one, always the
/// same ones.
class ChosenRuns {
 public:
  /// @param runs      Ascending; they outlive this.
  /// @param fraction  In [0, 1].
  ChosenRuns(std::span<const RunRange> runs, double fraction);

  [[nodiscard]] std::uint64_t size() const { return count_; }
  /// @param i  Below size(), and not below that of the call before.
  [[nodiscard]] RunIndex next(std::uint64_t i);

 private:
  std::span<const RunRange> runs_;
  std::uint64_t num_runs_;
  std::uint64_t count_;
  std::uint64_t num_before_ = 0;  ///< Runs in the ranges before `runs_`.
};

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
                                                           const IsStopped& is_stopped);

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
                                 std::size_t num_threads, const IsStopped& is_stopped);

}  // namespace proofmass::coordinator
