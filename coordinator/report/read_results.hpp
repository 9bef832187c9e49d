#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "coordinator/report/digest.hpp"
#include "coordinator/report/run_groups.hpp"
#include "coordinator/report/standard_errors.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/campaign/statistics.hpp"

namespace proofmass::coordinator {

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
