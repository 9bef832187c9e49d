#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "coordinator/report/run_groups.hpp"
#include "coordinator/report/standard_errors.hpp"
#include "coordinator/store/sha256.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/campaign/statistics.hpp"

namespace proofmass::coordinator {

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

/// Digest of the results in a campaign database, without that of their health.
[[nodiscard]] std::string digest_of(const Store& store);

/// What the digest that is stored with a file's statistics says of its results.
enum class DigestCheck : std::uint8_t {
  holds,        ///< It is that of the results.
  not_checked,  ///< It is of fewer results, or there is none yet.
};

/// Holds the results of a file against the digest that is stored with its statistics.
///
/// @param num_results  All results of the file, in the state of the file that is being read.
/// @param digests      Theirs.
/// @throws StoreError `campaign database = x.db (is damaged: ...)` if the digest is of as many
/// results and another one, if it is of more results, if the counts beside it do not add up, or if
/// there are statistics and none is there.
[[nodiscard]] DigestCheck check_digest(const Store& store, std::uint64_t num_results,
                                       const ResultDigests& digests);

/// What one walk over all results of a file tells of them.
struct WalkedResults {
  std::uint64_t num_results = 0;
  std::string digest;
  DigestCheck check = DigestCheck::holds;
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
  DigestCheck digest_check = DigestCheck::not_checked;  ///< See read_checked_results().
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

}  // namespace proofmass::coordinator
