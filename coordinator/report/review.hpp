#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/report/error_figures.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/run_spectra.hpp"
#include "coordinator/report/sensitivity.hpp"
#include "coordinator/report/summarise.hpp"
#include "coordinator/report/verification_matrix.hpp"
#include "coordinator/store/records.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {

/// Everything that reports and their charts are made of.
struct Review {
  std::string database = {};  ///< As commands name it; whoever read the review knows that.
  /// Options of `report` that make this one anew, as a shell reads them, each after a blank.
  std::string options = {};
  // What the database says of itself. Any of these texts may come from a stranger.
  std::string name = {};
  std::uint64_t seed = 0;
  std::uint64_t num_runs = 0;  ///< Wanted.
  std::string model_version = {};
  bool is_of_program = false;  ///< Its model needs one to be simulated again.
  bool is_imported = false;    ///< Model::is_imported().
  std::string note = {};       ///< Campaign::note().
  std::string build = {};
  std::string created_utc = {};
  std::string definition_digest = {};
  ResultSchema schema = {};  ///< What the results are.
  ReadResults results = {};
  std::vector<double> objectives = {};  ///< Of each quantity, SI.
  Interpretation interpretation = Interpretation::mixed;
  std::optional<ErrorBudget> budget = {};
  std::vector<QuantityFigures> figures = {};  ///< Of each quantity.
  /// In the order in which requirements are stated.
  std::vector<RequirementAnswer> matrix = {};
  /// See why_not_independent(); then the matrix has no verdicts to be shown.
  std::string why_not_independent = {};
  std::optional<Causes> causes = {};       ///< Empty if runs are too few, or not asked for.
  std::optional<RunSpectra> spectra = {};  ///< Of worst_run_of(); empty if not asked for.
  CampaignExecution execution = {};
  std::string stop = {};  ///< See stop_text().
  std::optional<StopOutcome> stop_outcome = {};
};

/// The run with the largest |error| of any quantity beside its objective; none if no run has an
/// estimate or no quantity has an objective.
[[nodiscard]] std::optional<RunIndex> worst_run_of(const Review& review);

/// What the matrix of a review says of a requirement that it was read with.
[[nodiscard]] const RequirementAnswer& answer_to(const StatedRequirement& stated,
                                                 const Review& review);

/// What a review has beside the results, each with what comes before it.
enum class ReviewDepth : std::uint8_t {
  tables,
  matrix,
  charts,  ///< Also how the campaign was executed.
  causes,
};

/// Reads all results, of one state of the file, as read_checked_results() does, and once more for
/// the causes.
///
/// @param stated  Requirements; of none, the objectives. All objectives together follow, unless
///                they are asked for or the campaign has none.
/// @throws ConfigError as parse_requirement(); StoreError as read_checked_results().
[[nodiscard]] Review read_review(const Store& store, const Campaign& campaign, ReviewDepth depth,
                                 std::vector<StatedRequirement> stated = {});

}  // namespace proofmass::coordinator
