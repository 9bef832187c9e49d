#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <vector>

#include "coordinator/table/table.hpp"
#include "core/campaign/run_result.hpp"
#include "core/campaign/sampling_design.hpp"
#include "core/error.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/variance_components.hpp"

namespace proofmass::coordinator {

/// Splits results in run order into groups of one size: the runs of an instrument, or of a
/// replicate of a design. Group g has the runs from g·size on.
class RunGroups {
 public:
  explicit RunGroups(std::uint64_t size) : size_(size) { PROOFMASS_EXPECT(size_ > 1); }

  /// @return The runs of the group that this one completes, until the next call; else none.
  [[nodiscard]] std::span<const RunResult> add(const RunResult& run) {
    if (!runs_.empty() && number_of(runs_.front()) != number_of(run)) (void)incomplete();
    runs_.push_back(run);
    return runs_.size() < size_ ? std::span<const RunResult>() : runs_;
  }
  /// Numbers of the groups that lack a run. @pre Every result was added.
  [[nodiscard]] const std::vector<std::uint64_t>& incomplete() {
    const bool is_cut_short = !runs_.empty() && runs_.size() < size_;
    if (is_cut_short) incomplete_.push_back(number_of(runs_.front()));
    runs_.clear();
    return incomplete_;
  }

 private:
  [[nodiscard]] std::uint64_t number_of(const RunResult& run) const {
    return run.run.value / size_;
  }

  std::uint64_t size_;
  std::vector<RunResult> runs_;  ///< Of the last group.
  std::vector<std::uint64_t> incomplete_;
};

template <typename IsHit>
std::uint64_t count_of(std::span<const RunResult> runs, const IsHit& is_hit) {
  return static_cast<std::uint64_t>(std::ranges::count_if(runs, is_hit));
}

/// Whether a run without an estimate, or with a larger |error|, misses the objective of a quantity.
inline bool is_beyond(const RunResult& run, std::size_t quantity, double objective) {
  return !run.is_completed() || std::abs(run.error(quantity)) > objective;
}

/// A share of runs, with the instrument as the unit of its interval.
struct GroupedShare {
  double share = 0.0;
  Interval interval;
};

/// Whether standard errors are honest over instruments and within each of them. A run without an
/// estimate is not covered.
struct GroupedStandardErrors {
  std::optional<double> within_ratio;  ///< Variance within instruments over the mean of σ².
  GroupedShare covered;  ///< |error| within normal_95 σ: 95 % if σ is honest over all.
  /// Of n runs of an instrument with an estimate |error − their mean|·√(n/(n − 1)) within normal_95
  /// σ: 95 % if σ is all noise, and more the more of it is the instrument's.
  GroupedShare covered_within;
};

/// One quantity in all instruments.
struct InstrumentQuantity {
  OneWayAnalysis error;         ///< Of the instruments all of whose runs have an estimate.
  double mean_magnitude = 0.0;  ///< Of |error|, over the same ones.
  std::optional<Interval> magnitude_interval = {};
  /// Of the runs whose |error| is above the objective, and of those without an estimate.
  GroupedShare beyond;
  std::optional<GroupedStandardErrors> standard_errors = {};
};

/// What several realisations of the noise for each instrument tell. Shares are over all runs of the
/// instruments that are counted.
struct InstrumentStatistics {
  std::uint64_t realisations = 0;
  std::uint64_t num_instruments = 0;           ///< All of whose runs are finished or given up.
  std::uint64_t num_incomplete = 0;            ///< Of which a run is not finished yet: left out.
  std::uint64_t num_not_estimated = 0;         ///< With a run that has no estimate.
  std::vector<InstrumentQuantity> quantities;  ///< Empty without an instrument.
  // All objectives hold, in the three interpretations of ECSS-E-ST-60-10C.
  GroupedShare mixed;          ///< Of all runs.
  GroupedShare ensemble;       ///< Of the instruments: in each of their realisations.
  std::uint64_t temporal = 0;  ///< Realisations of the instrument in which they hold least often.
  std::uint64_t num_temporal = 0;         ///< Instruments in which they hold that often.
  std::uint64_t temporal_instrument = 0;  ///< The first of them.
};

/// Computes them from results in run order. Memory is fixed. A run that was given up is to be added
/// as a lost one.
class RunningInstruments {
 public:
  /// @param objectives    Of each quantity, SI.
  /// @param realisations  At least 2.
  RunningInstruments(const ResultSchema& schema, std::vector<double> objectives,
                     std::uint64_t realisations);

  void add(const RunResult& result);
  /// @pre Every result was added; to be called once.
  [[nodiscard]] InstrumentStatistics statistics();

 private:
  struct Quantity {
    GroupedValues errors;
    MomentSums magnitudes{0.0};  ///< Of the instruments' means.
    GroupedHits beyond, covered, covered_within;
    std::optional<std::size_t> position = {};  ///< Of its standard error, if it has one.
    double squared_standard_errors = 0.0;      ///< Sum over the runs in `errors`.
  };
  using Runs = std::span<const RunResult>;  // Of an instrument.
  void add_objectives(Runs runs);
  void add_values(Runs runs, std::size_t i);
  [[nodiscard]] InstrumentQuantity statistics_of(std::size_t i) const;

  std::vector<double> objectives_;
  RunGroups groups_;
  InstrumentStatistics counts_;
  GroupedHits within_;
  std::uint64_t num_within_always_ = 0;
  bool have_standard_errors_ = false;
  std::vector<Quantity> quantities_;
};

/// Variances between instruments and within; says so if there is no complete instrument.
[[nodiscard]] Table variance_table(const ResultSchema& schema,
                                   const InstrumentStatistics& statistics);

/// Biases, and shares of runs. No rows without a complete instrument.
[[nodiscard]] Table instrument_table(const ResultSchema& schema,
                                     const InstrumentStatistics& statistics);

/// All of it for programs.
[[nodiscard]] nlohmann::ordered_json json_of(const ResultSchema& schema,
                                             const InstrumentStatistics& statistics);

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
