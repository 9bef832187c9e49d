#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
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
  std::string computed;  ///< The same.
};

/// Every column that differs in a bit that means something; if the status does, that one alone.
[[nodiscard]] std::vector<ResultDifference> differences_of(const RunResult& stored,
                                                           const RunResult& computed);

/// Simulates the runs of some results again, with the fastest kernel of this processor.
///
/// @param stored       Of the campaign; a run of theirs has all table values that it needs.
/// @param num_threads  That simulate; at least 1. The result does not depend on it.
/// @return All differences, by run.
/// @throws Interrupted.
[[nodiscard]] std::vector<ResultDifference> simulate_again(const Campaign& campaign,
                                                           std::span<const RunResult> stored,
                                                           std::size_t num_threads,
                                                           const IsStopped& is_stopped);

}  // namespace proofmass::coordinator
