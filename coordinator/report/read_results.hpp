#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "coordinator/report/standard_errors.hpp"
#include "coordinator/store/sha256.hpp"
#include "coordinator/store/store.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/campaign/sampling_design.hpp"
#include "core/campaign/statistics.hpp"
#include "core/error.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/variance_components.hpp"

namespace proofmass::coordinator {

/// The runs that tests and verdicts are about: from the first that is settled (finished or given
/// up) to the next that is not. Where runs that exceed take longer, later ones are a biased sample
/// as long as earlier ones are missing.
struct JudgedRuns {
  std::uint64_t end = num_runs_max;
  std::uint64_t num_given_up = 0;  ///< Below `end`.
  std::uint64_t num_left_out = 0;  ///< Settled, but not before the first that is missing.
};

/// @param finished  Ascending, as are those given up; no run is both.
[[nodiscard]] JudgedRuns judged_runs(std::vector<RunRange> finished,
                                     std::span<const RunRange> given_up);

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
  bool is_too_skewed = false;  ///< The instruments' mean |error|, for Student's law.
  /// Of the runs whose |error| is above the objective, and of those without an estimate; empty
  /// without an objective.
  std::optional<GroupedShare> beyond = {};
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
  bool is_too_skewed = false;  ///< The replicates' means, for that law.
};

/// estimate − truth of one quantity, SI.
struct ReplicatedQuantity {
  ReplicatedMean magnitude;    ///< |error|.
  ReplicatedMean bias;         ///< error.
  ReplicatedMean mean_square;  ///< error².
  /// Share of runs whose |error| is above the objective, or that have no estimate; empty without an
  /// objective.
  std::optional<ReplicatedMean> beyond = {};
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

/// SHA-256 over results in run order: two files of one campaign have the same digest,
/// whichever workers computed the runs and in whatever order they arrived.
///
/// A result of n quantities, m of them with a standard error, is 24 + 16 n + 8 m bytes,
/// little-endian: run index (64 bits), status, draws, rounds (32 bits each), 32 bits of zero, then
/// the truth and the estimate of each quantity (doubles; 0 where they mean nothing, no negative
/// zeros), and the standard errors.
///
/// The health of loops has a digest of its own, so that that of the results is the same as of
/// before there was any. Of a result that has it, these are run index, the numbers in the order of
/// ResultSchema::health, cause and session of the loss (32 bits each; 0 unless the run is lost).
class Digest {
 public:
  explicit Digest(const ResultSchema& schema);

  void add(const RunResult& result);

  /// @pre Called once, at the end.
  [[nodiscard]] ResultDigests finish();

 private:
  std::size_t num_quantities_;
  Sha256 hash_;
  Sha256 health_hash_;
  bool has_health_ = false;
};

/// Holds the results of a file against the digest that is stored with its statistics.
///
/// @param num_results  All results of the file, in the state of the file that is being read.
/// @param digests      Theirs.
/// @return False if they were not checked: the stored one is of fewer results, or there is none
/// yet.
/// @throws StoreError `campaign database = x.db (is damaged: ...)` if the digest is of as many
/// results and another one, if it is of more results, if the counts beside it do not add up, or if
/// there are statistics and none is there.
[[nodiscard]] bool check_digest(const Store& store, std::uint64_t num_results,
                                const ResultDigests& digests);

/// What one walk over all results of a file tells of them.
struct WalkedResults {
  std::uint64_t num_results = 0;
  std::string digest;
  bool is_digest_checked = true;
};

/// Calls visit(result) for each result of a file, in run order and of one state of the file, and
/// holds them against the stored digest at the end.
/// @throws StoreError as check_digest() and Store::for_each_result() do.
[[nodiscard]] WalkedResults walk_checked(const Store& store,
                                         const std::function<void(const RunResult&)>& visit);

/// To be called before results are added to those of a file: its statistics and their digest are
/// made anew then, and would make a damaged file valid. Reads all results if there is a digest of
/// them all, and otherwise nothing: what was stored since the last one cannot be checked.
/// @throws StoreError as walk_checked() does.
void check_results_before_more(const Store& store);

/// Holds what defines a campaign, its data files and its tables of drawn values against the digest
/// that is stored with them.
/// @throws StoreError `campaign database = x.db (is damaged: ...)`.
void check_definition_digest(const Store& store);

/// Runs that have no estimate that converged, by reason: statistics leave them out, and say so.
struct MissingEstimates {
  std::uint64_t num_not_converged = 0;
  std::uint64_t num_not_finite = 0;
  std::uint64_t num_no_draw = 0;
  std::uint64_t num_lost = 0;
  std::uint64_t num_given_up = 0;  ///< Having crashed workers: without a result.

  /// Counts a result unless it is completed.
  void add(const RunResult& result);
  [[nodiscard]] std::uint64_t total() const;

  bool operator==(const MissingEstimates&) const = default;
};

/// `2 not finite, 1 without draw`, at most 76 characters; empty if there are none.
[[nodiscard]] std::string reasons_text(const MissingEstimates& missing);

/// The budget totals that the errors of single runs leave, m/s². The total of the worst errors of
/// all parameters is larger: no run has them all.
struct RunTotals {
  double worst = 0.0;
  RunIndex worst_run;  ///< The first run that reaches `worst`.
  double median = 0.0;
  double percentile_95 = 0.0;
};

/// How often an effect may have moved an estimate.
struct WarnedQuantity {
  std::string_view effect;
  std::size_t quantity = 0;    ///< Index into the quantities of the ResultSchema.
  std::uint64_t num_runs = 0;  ///< That have this warning.
  double largest_part = 0.0;   ///< Of the objective.
  RunIndex run = {};           ///< The first with the largest part.
};

/// The warnings of a campaign's completed runs.
struct CampaignWarnings {
  std::uint64_t num_runs = 0;              ///< With a warning of any kind.
  std::vector<WarnedQuantity> quantities;  ///< In the order in which they first occur.
  std::vector<RunWarning> first;           ///< num_warnings_kept at most, in run order.
};

/// `12 completed with a warning ...` and a line for each effect and quantity; empty without any.
[[nodiscard]] std::string warnings_text(const ResultSchema& schema,
                                        const CampaignWarnings& warnings);

/// Runs whose loops left their limits in the same way.
struct LostRuns {
  Loss loss;
  std::uint64_t num_runs = 0;
};

/// What the results of a campaign database yield.
struct ReadResults {
  CampaignStatistics statistics;
  ResultDigests digests;
  std::optional<RunTotals> totals;  ///< Empty if no run has an estimate.
  CampaignWarnings warnings;
  StandardErrorStatistics standard_errors;
  std::optional<InstrumentStatistics> instruments = {};  ///< With several realisations for each.
  std::optional<ReplicateStatistics> replicates = {};    ///< Of a sampling design.
  std::vector<RunRange> given_up = {};                   ///< Ascending.
  MissingEstimates missing = {};
  std::vector<LostRuns> losses = {};  ///< Of missing.num_lost, in order of the first of each.
  bool is_digest_checked = false;     ///< See read_checked_results().
};

/// Sees what read_results() reads.
struct ResultVisitor {
  /// Called with all results, in run order.
  std::function<void(const RunResult&)> result;
  /// Called after that for each quantity, if a run has an estimate, with |error| of the completed
  /// runs, SI, in ascending order.
  std::function<void(std::size_t quantity, std::span<const double> magnitudes)> magnitudes;
};

/// Reads all results, of one state of the file, and then, if they are too many for 128 MB, the
/// errors of one quantity after the other: 8 bytes a run.
/// @throws Error if a number is out of range, see require_in_range().
[[nodiscard]] ReadResults read_results(const Store& store, const Campaign& campaign,
                                       const ResultVisitor& further = {});

/// Reads all results, of one state of the file, and holds them against what is stored beside them.
/// @throws StoreError if results, given-up runs or stop checks are not what was stored; see
///         check_digest().
[[nodiscard]] ReadResults read_checked_results(const Store& store, const Campaign& campaign,
                                               const ResultVisitor& further = {});

/// Stores statistics, their digest, and the budgets that follow from them in the file.
void write_statistics(Store& store, const Campaign& campaign, const ReadResults& results);

/// Brings the statistics and budgets that are stored in the file up to its results; does nothing
/// if they are.
void update_statistics(Store& store, const Campaign& campaign);

/// Brings the statistics of a campaign database up to its results and, if they are those of all
/// runs that it is to have for now, checks its stop rule with them.
///
/// @param write  Lets its argument use the file where it is written.
/// @return The number of runs that the stop rule asks for next; empty if there is none, if it was
///         not checked or is reached, or if there are as many runs as there may be.
std::optional<std::uint64_t> summarise_file(
    const std::filesystem::path& file, const Campaign& campaign,
    const std::function<void(const std::function<void(Store&)>&)>& write);

/// What `stop_check` has other than the results yield, a line each:
/// `stop_check.estimate of std(gain) after 128 runs = 1 (must be 2.5)`.
///
/// Beside the rows that are there, that of the campaign's rule and of all runs must be there once
/// the campaign has ended.
///
/// Rows of n runs are held against the results if all runs below n are finished, and were when the
/// rule was checked, as no loss was blamed on any of them.
/// @pre All results are in range, and one state of the file is read.
/// @param objectives  Those of the campaign's scenario.
[[nodiscard]] std::vector<std::string> stop_check_differences(const Store& store,
                                                              std::span<const double> objectives);

/// What came of a campaign's stop rule.
struct StopOutcome {
  std::string rule = {};                   ///< As it was given.
  std::optional<StopCheckRow> check = {};  ///< That with the most runs; empty if there was none.
  std::string answer = {};  ///< `reached` or `not reached`, or that of a requirement; or empty.
  /// Lines of at most 80 characters unless the rule is longer; empty if it was not checked.
  std::string text = {};
  bool is_missed = false;  ///< See is_rule_missed().
};

/// Empty without a rule.
[[nodiscard]] std::optional<StopOutcome> stop_outcome(const Store& store);

/// True if a campaign has a stop rule that was not checked with as many runs as the campaign is to
/// have for now.
[[nodiscard]] bool lacks_stop_check(const Store& store);

/// True if a campaign has a stop rule that was not checked, see lacks_stop_check(), or not reached,
/// or one that ends in `decided` whose requirement is not met.
[[nodiscard]] bool is_rule_missed(const Store& store);

}  // namespace proofmass::coordinator
