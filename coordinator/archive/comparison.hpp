#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/statistics/error_change.hpp"
#include "core/statistics/interval.hpp"

namespace proofmass::coordinator {

/// Results in run order, one a call; empty after the last.
using ResultStream = std::function<std::optional<RunResult>()>;

/// A campaign that is compared with another.
struct ComparedCampaign {
  std::shared_ptr<const Campaign> campaign;
  std::string model_version;
  std::string build;
  std::uint64_t num_given_up = 0;  ///< Runs without a result.
  /// Begins with the first result, the same ones each time: they are read several times and not
  /// kept.
  std::function<ResultStream()> open_results;
};

/// Names the campaign of the file. The first stream of results that is opened holds them against
/// the stored digest at its end, so that no further pass is needed for that; compare_campaigns()
/// reads it to its end before anything else. The Store outlives what is returned, and one state of
/// the file is read meanwhile (Store::read_one_state()).
/// @throws StoreError or DefinitionError if the file cannot be read; Interrupted. So do the
///         streams, and StoreError if the file holds other results than were stored, see
///         check_digest().
[[nodiscard]] ComparedCampaign read_compared(const Store& store, const IsStopped& is_stopped);

/// estimate − truth of one parameter over the runs of one side that are compared, SI.
struct ComparedAccuracy {
  double bias = 0.0;                ///< Mean of estimate − truth.
  double standard_deviation = 0.0;  ///< Of estimate − truth, with n − 1; 0 for a single run.
  double mean = 0.0;                ///< Of |estimate − truth|.
  double worst = 0.0;               ///< Largest |estimate − truth|.
  std::size_t num_in_tail = 0;  ///< Runs with |estimate − truth| > ParameterComparison::tail_limit.
};

/// One parameter in two campaigns.
struct ParameterComparison {
  ComparedAccuracy first;
  ComparedAccuracy second;
  std::optional<Interval> bias_interval;  ///< Of second bias − first; empty if nothing varies.
  double tail_limit = 0.0;                ///< tail_limit() of both campaigns, SI.
  /// See smallest_scale_factor(); empty below num_welch_min runs unless runs are paired.
  std::optional<double> smallest_scale_factor;
  ChangePValues p_values;           ///< That chance alone makes such a change.
  ChangePValues adjusted_p_values;  ///< That chance alone makes one in any test of all parameters.
};

/// What two campaigns differ in, and what that does to the accuracy.
struct CampaignComparison {
  /// Of the definitions, then `model` and `build`.
  std::vector<DefinitionDifference> differences;
  /// Why the draws are not the same, run by run; empty if they are, and pairs are compared.
  std::string why_unpaired;
  std::size_t num_first = 0;   ///< Runs of the first campaign that are compared.
  std::size_t num_second = 0;  ///< Runs of the second campaign; num_first if paired.
  /// Finished and given-up runs of each whole campaign that have no estimate: they may be its
  /// worst.
  MissingEstimates missing_in_first;
  MissingEstimates missing_in_second;
  /// Why the parameters are not compared; empty if they are.
  std::string why_not_compared;
  std::vector<ParameterComparison> parameters;  ///< Of each quantity.

  [[nodiscard]] bool is_paired() const { return why_unpaired.empty(); }
};

/// Compares the runs with an estimate: those that both campaigns have, run by run, if their seed
/// and the truths of all common runs agree to the last bit, and else all of each. P-values are of
/// compare_paired_errors() for pairs, else of compare_many_errors(), or compare_few_errors() below
/// num_welch_min runs; intervals are of 95 %.
///
/// Keeps nothing of each run, but 16 bytes of each pair, as ranks need all differences of a
/// parameter, and 128 MB of several parameters' at a time to save passes.
[[nodiscard]] CampaignComparison compare_campaigns(const ComparedCampaign& first,
                                                   const ComparedCampaign& second);

}  // namespace proofmass::coordinator
