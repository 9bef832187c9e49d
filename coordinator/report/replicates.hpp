#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "coordinator/report/run_groups.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/run_result.hpp"
#include "core/campaign/sampling_design.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"

namespace proofmass::coordinator {

/// A mean over the runs of complete replicates.
struct ReplicatedMean {
  double mean = 0.0;  ///< Of the replicates' means.
  /// By Student's law of the replicates' means, 95 %; empty where they cannot tell, see
  /// RunningReplicates::statistics().
  std::optional<Interval> interval = {};
};

/// estimate − truth of one quantity, SI.
struct ReplicatedQuantity {
  ReplicatedMean magnitude;    ///< |error|.
  ReplicatedMean bias;         ///< error.
  ReplicatedMean mean_square;  ///< error².
  /// Share of runs whose |error| is above the objective, or that have no estimate.
  ReplicatedMean beyond;
  /// Share of completed runs whose |error| is within normal_95 standard errors; if there are any.
  std::optional<ReplicatedMean> covered = {};
};

/// What the replicates of a sampling design tell, with the replicate as the unit of intervals.
struct ReplicateStatistics {
  SamplingDesign design;
  /// All of whose runs are finished or given up; the basis of all else.
  std::uint64_t num_replicates = 0;
  std::vector<std::uint64_t> incomplete;  ///< Of which a run is not finished yet; the first few.
  std::uint64_t num_incomplete = 0;
  std::uint64_t num_estimated = 0;    ///< Completed runs of complete replicates.
  std::uint64_t num_drawn_again = 0;  ///< Runs of complete replicates that left their points.
  ReplicatedMean within_objectives;   ///< Share of runs; one without an estimate misses them.
  std::vector<ReplicatedQuantity> quantities;  ///< Of completed runs; empty without any.
};

/// Fewest replicates that make an interval.
inline constexpr std::uint64_t num_replicates_of_interval = 8;

/// Fewest runs on each side of a limit that make an interval of their shares.
inline constexpr std::uint64_t num_hits_of_interval = 20;

/// Least standard deviation of the number of such runs in a replicate that makes an interval.
inline constexpr double count_deviation_min = 0.5;

/// Computes them from results in run order. Memory is fixed. A run that was given up is to be added
/// as a lost one.
class RunningReplicates {
 public:
  /// @param objectives  Of each quantity, SI.
  /// @param design      Not `random`.
  RunningReplicates(const ResultSchema& schema, std::vector<double> objectives,
                    const SamplingDesign& design);

  void add(const RunResult& result);
  /// An interval needs num_replicates_of_interval replicates, one of a share also
  /// num_hits_of_interval runs that are counted and as many that are not, and count_deviation_min.
  /// @pre Every result was added; to be called once.
  [[nodiscard]] ReplicateStatistics statistics();

 private:
  /// A mean of each replicate.
  struct Mean {
    double total = 0.0;  ///< Over all runs of complete replicates.
    std::optional<MomentSums> means = {};

    /// @param sum  Over so many runs of a replicate.
    void add(double sum, std::uint64_t num_runs);
    [[nodiscard]] ReplicatedMean mean() const;
    /// Of values 0 and 1.
    [[nodiscard]] ReplicatedMean share(std::uint64_t num_runs) const;
  };
  struct Quantity {
    std::optional<std::size_t> position = {};  ///< Of its standard error, if it has one.
    Mean magnitude = {}, bias = {}, mean_square = {}, beyond = {}, covered = {};
  };

  std::vector<double> objectives_;
  RunGroups groups_;
  ReplicateStatistics counts_;
  bool have_standard_errors_ = false;
  Mean within_;
  std::vector<Quantity> quantities_;
};

/// Intervals with the replicate as their unit, and shares of runs. No rows without a completed run
/// in a complete replicate.
[[nodiscard]] Table replicate_table(const ResultSchema& schema,
                                    const ReplicateStatistics& statistics);

/// The rows of replicate_table() as JSON, for programs.
[[nodiscard]] nlohmann::ordered_json json_of(const ResultSchema& schema,
                                             const ReplicateStatistics& statistics);

}  // namespace proofmass::coordinator
