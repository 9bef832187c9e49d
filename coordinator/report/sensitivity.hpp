#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/report/read_results.hpp"
#include "coordinator/store/store.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/runs.hpp"
#include "core/statistics/sensitivity.hpp"

namespace proofmass::coordinator {

/// What was drawn for runs that have an estimate, and how far their estimates are off. Draws are
/// made again from the definition; no file holds them.
struct DrawnRuns {
  std::uint64_t num_with_estimate = 0;         ///< In the whole campaign database.
  std::optional<RunIndex> last_with_estimate;  ///< Empty if there is none.
  std::uint64_t num_first = 0;                 ///< Runs that are here as the first ones.
  std::vector<RunIndex> runs;                  ///< Ascending; n of them.
  MissingEstimates missing;  ///< Runs among these that are left out; all that are given up.
  /// Drawn quantities as in Model::drawn(), then the true parameters that follow from them, as in
  /// `truth_offset_m`. Units are in the names.
  std::vector<std::string> names;
  std::vector<Quantity> quantities;          ///< Whose errors these are.
  std::vector<std::vector<double>> columns;  ///< Their values, shape [names.size()][n].
  std::vector<std::vector<double>> errors;   ///< estimate − truth, SI; shape [quantities][n].

  [[nodiscard]] bool is_part() const { return runs.size() < num_with_estimate; }
  /// What a superlative is followed by.
  [[nodiscard]] std::string_view of_these() const { return is_part() ? " of these" : ""; }
};

/// The first runs of a campaign database that have an estimate, `num_runs_max` of them at most.
/// @param campaign  The definition in the file.
/// @param also      A run that is kept in any case if it has an estimate.
/// @throws StoreError as walk_checked() does.
[[nodiscard]] DrawnRuns read_drawn_runs(const Store& store, const Campaign& campaign,
                                        std::uint64_t num_runs_max,
                                        std::optional<RunIndex> also = std::nullopt);

/// Runs that sensitivities are computed from at most: a million would take minutes and say no more.
/// The texts say so where a campaign has more.
inline constexpr std::uint64_t sensitivity_runs_max = 100'000;

[[nodiscard]] std::vector<ExplanatoryTerm> terms_of(const DrawnRuns& drawn, std::size_t quantity);

/// Which drawn quantities drive a parameter's error, and which its magnitude: the first `num_rows`
/// of sensitivities() of each, by default five or none where chance alone explains the influence
/// of each, and the error as a sum of
/// explanatory_terms(), and how to ask why the worst run is so. Of a run, why it is as far off as
/// it is: the place of its |error| among the runs, its values of these quantities, each with its
/// percentile, and what the terms add to its error. Lines have at most 80 characters. Empty without
/// a run if there is nothing to name, see unexplained_text().
/// @throws InvalidArgument below 16 runs, or if the run is not among them.
[[nodiscard]] std::string sensitivity_text(const DrawnRuns& drawn, std::size_t quantity,
                                           std::optional<RunIndex> run = {},
                                           std::optional<std::size_t> num_rows = {},
                                           Paint paint = Paint::no);

/// That chance explains the errors of these parameters, of which there is one at least.
[[nodiscard]] std::string unexplained_text(const DrawnRuns& drawn,
                                           std::span<const std::size_t> quantities);

/// That for programs, of these parameters, in full precision and SI units; of the run's values only
/// if there is one. coordinator/cli/README.md lists the keys.
/// @throws InvalidArgument if the run is not among those, or they are below 16.
[[nodiscard]] nlohmann::ordered_json sensitivity_json(const DrawnRuns& drawn,
                                                      std::span<const std::size_t> quantities,
                                                      std::optional<RunIndex> run,
                                                      std::optional<std::size_t> num_rows = {});

/// The parameter whose |error| is the largest in units of its objective; of those without
/// objectives, the one for which the |error| has the highest rank.
/// @param objectives  Those of the campaign's scenario, one a parameter.
/// @throws InvalidArgument if the run is not among those.
[[nodiscard]] std::size_t worst_quantity_of(const DrawnRuns& drawn, RunIndex run,
                                            std::span<const double> objectives);

/// Which parameter that is and why, in lines of at most 80 characters.
/// @throws InvalidArgument if the run is not among those.
[[nodiscard]] std::string choice_text(const DrawnRuns& drawn, RunIndex run,
                                      std::span<const double> objectives);

/// A part of the sum that explains the error of a quantity, see explanatory_terms().
struct CauseTerm {
  std::size_t quantity = 0;
  std::string name;       ///< A drawn quantity, a true parameter, or a product: `true a × true b`.
  ExplanatoryTerm found;  ///< Slope in SI units.
};

/// How the errors of a campaign follow from what its runs drew.
struct Causes {
  std::uint64_t num_runs = 0;           ///< That were used: the first ones with an estimate.
  std::uint64_t num_with_estimate = 0;  ///< In the database.
  std::vector<CauseTerm> terms = {};    ///< By quantity, the largest share first.
  /// The terms and what else correlates the most with an error, each once.
  std::vector<std::string> inputs = {};
  /// Linear correlation with the error, sign included, shape [inputs][quantities]. Empty where one
  /// of both does not vary, and below 4/√n, which chance alone exceeds in one case of 15,000.
  std::vector<std::vector<std::optional<double>>> correlations = {};
};

/// @return Nothing below 16 runs with an estimate.
/// @throws StoreError as read_drawn_runs() does.
[[nodiscard]] std::optional<Causes> find_causes(const Store& store, const Campaign& campaign);

}  // namespace proofmass::coordinator
