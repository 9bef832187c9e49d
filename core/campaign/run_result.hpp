#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/runs.hpp"

namespace proofmass {

/// Published errors |estimate − truth| of a quantity, SI.
struct PublishedAccuracy {
  double worst = 0.0;
  double mean = 0.0;
  double standard_deviation = 0.0;
};

/// A quantity that a model estimates in each run, and whose true value it knows.
struct Quantity {
  std::string name;               ///< In files, SQL and logs: `a_c11_delta_x`; [a-z0-9_]+.
  std::string_view unit_suffix;   ///< Unit as a name suffix: `_m`, `_rad`, `_s2_m` or empty.
  std::string_view symbol;        ///< For people: `a_c11·Δx`.
  std::string_view unit;          ///< For people, SI: `m`, `rad`, `s²/m` or `1`.
  double display_scale = 1.0;     ///< A table shows value / display_scale ...
  std::string_view display_unit;  ///< ... in this unit: `nm`, `1e-4 rad`.
  /// Largest acceptable |error|, SI, unless a campaign has another; infinite if there is none.
  double objective = std::numeric_limits<double>::infinity();
  std::optional<PublishedAccuracy> published = {};
  bool has_standard_error = false;  ///< True if estimates come with one.

  /// `a_c11_delta_x_m`, the end of the column names of this quantity.
  [[nodiscard]] std::string column() const { return name + std::string(unit_suffix); }
};

/// A number from 0 to magnitude_max that tells how well a run went, the larger, the worse; or how
/// well its estimates fit what was measured.
struct HealthQuantity {
  std::string name;              ///< In files: `acceleration`; [A-Za-z0-9_]+.
  std::string_view unit_suffix;  ///< `_m_s2`, `_rad` or empty.
  std::string_view unit;         ///< `m/s²`, `rad` or `1`.

  [[nodiscard]] std::string column() const { return name + std::string(unit_suffix); }
};

/// Most quantities of a campaign: a database keeps a bit for each.
inline constexpr std::size_t quantities_max = 63;

/// Says what the numbers of a campaign's results are. The order of the lists is that of the values
/// in a RunResult, of columns, exports and digests. Numbers that are stored count from 1, so that
/// lists may grow at their end and never otherwise.
struct ResultSchema {
  std::vector<Quantity> quantities;  ///< 1 to quantities_max.
  std::vector<HealthQuantity> health;
  std::vector<std::string_view> loss_causes;    ///< Why a run may be lost: `saturation`.
  std::vector<std::string_view> loss_sessions;  ///< In which part of it: `a_c12`.
  std::uint32_t num_draws_max = 1;              ///< Most draws of one run.
  /// Of the published figures, for people: `Hardy et al. 2013`, 20 characters at most; empty
  /// without any.
  std::string_view published_source = {};
  /// Of campaigns that have an ErrorBudget: names of its terms, and the health quantity that is its
  /// level.
  std::vector<std::string_view> budget_terms = {};
  std::size_t budget_level = 0;
  /// How well estimates that have standard errors fit what was measured: χ² and its degrees of
  /// freedom, of all data and then of each of `fit_parts`; or nothing.
  std::vector<HealthQuantity> fit = {};
  std::vector<std::string> fit_parts = {};  ///< Names of the sessions that have their own: `a_c12`.
  /// By so much, relative, χ² may be off in the mean although the noise is what the method takes
  /// it for.
  double fit_tolerance = 0.0;
};

/// Quantities that have a standard error.
[[nodiscard]] std::size_t num_standard_errors(const ResultSchema& schema);

/// How many RunResult::correlations there are.
[[nodiscard]] std::size_t num_correlations(const ResultSchema& schema);

/// The name at a position from 1, as in Loss; `none` at 0.
[[nodiscard]] std::string_view name_at(const std::vector<std::string_view>& names,
                                       std::uint32_t position);

/// Index of the quantity of that name; nothing if there is none.
[[nodiscard]] std::optional<std::size_t> find_quantity(const ResultSchema& schema,
                                                       std::string_view name);

/// The quantity that texts take as an example: the one in the middle. It is the same as long as the
/// list is, because comments in the schema of every database name it.
[[nodiscard]] Quantity example_quantity(const ResultSchema& schema);

/// The names of all quantities, in their order; they are those of the schema, which outlives them.
[[nodiscard]] std::vector<std::string_view> quantity_names(const ResultSchema& schema);

/// What is larger than any truth or estimate, SI: cubes of errors can be added up over any number
/// of runs.
inline constexpr double magnitude_max = 1e90;

/// False for infinities and NaN, too.
[[nodiscard]] inline bool is_in_range(double value) { return std::abs(value) <= magnitude_max; }

/// How a run ended. The values are stored and sent: never renumber.
enum class RunStatus : std::uint8_t {
  completed = 1,      ///< All estimates converged.
  not_converged = 2,  ///< Estimates are those of the last allowed round.
  not_finite =
      3,        ///< An estimate or its standard error is not in range, see is_in_range(); truth is.
  no_draw = 4,  ///< No draw inside the acceptance bounds was found; neither truth nor estimate.
  lost = 5,     ///< The run left the limits of its model, see Loss; truth holds, estimates do not.
};

/// `not_converged`, for people and files.
[[nodiscard]] std::string_view name_of(RunStatus status);

/// Why and where a run was lost: positions in the lists of the ResultSchema, from 1; 0 if it was
/// not.
struct Loss {
  std::uint32_t cause = 0;
  std::uint32_t session = 0;

  bool operator==(const Loss&) const = default;
};

/// `saturation in a_c12`.
[[nodiscard]] std::string loss_text(const ResultSchema& schema, const Loss& loss);

/// Everything a run yields. The same bits whatever worker, thread or attempt computed it. A
/// ResultSchema says what the values are; a list is empty if its values have no meaning.
struct RunResult {
  RunIndex run;
  RunStatus status = RunStatus::completed;
  std::uint32_t num_draws = 0;     ///< Draws taken until one lay inside the acceptance bounds.
  std::uint32_t num_rounds = 0;    ///< Estimation rounds until no estimate moved any more.
  std::vector<double> truth{};     ///< Of each quantity, SI; if has_truth().
  std::vector<double> estimate{};  ///< Of each quantity, SI; if has_estimate().
  std::vector<double> standard_error{};  ///< SI, of those quantities that have one; or empty.
  std::vector<double> fit{};             ///< Of each fit quantity, beside standard_error.
  /// Of each pair of estimates that have a standard error, (0, 1), (0, 2) ..., beside these.
  std::vector<double> correlations{};
  std::vector<double> health{};  ///< Of each health quantity; may be empty if has_truth().
  Loss loss{};                   ///< Says more if the status is `lost`.

  /// True if `truth` means something.
  [[nodiscard]] bool has_truth() const { return status != RunStatus::no_draw; }
  /// True if `estimate` means something.
  [[nodiscard]] bool has_estimate() const {
    return status == RunStatus::completed || status == RunStatus::not_converged;
  }
  /// True if the errors of `estimate` enter statistics. Those of the last allowed round do not: how
  /// far they still had to go is not known, and such a run counts as a miss.
  [[nodiscard]] bool is_completed() const { return status == RunStatus::completed; }
  /// estimate − truth of a quantity, SI; meaningful if has_estimate().
  [[nodiscard]] double error(std::size_t quantity) const {
    return estimate[quantity] - truth[quantity];
  }
};

/// The rules about its counts that a result breaks; no simulation yields a result that breaks one.
///
/// @param num_draws_max   Of the campaign's ResultSchema.
/// @param num_rounds_max  Of the campaign: Campaign::num_rounds_max().
/// @return Each as `num_draws = 0 (must be 1 to 1000 if completed)`.
[[nodiscard]] std::vector<std::string> broken_count_rules(const RunResult& result,
                                                          std::uint32_t num_draws_max,
                                                          std::int64_t num_rounds_max);

/// The lists of a new result that are not as long as its status and the schema make them, and a
/// loss for which the schema has no name; no simulation yields a result with one.
/// @return Each as `truth = 9 entries (must be 10 if completed)`.
[[nodiscard]] std::vector<std::string> broken_size_rules(const RunResult& result,
                                                         const ResultSchema& schema);

/// Statistics would be nonsense, or never end.
/// @throws Error if a truth or estimate that means something is out of range.
void require_in_range(const RunResult& result, const ResultSchema& schema);

}  // namespace proofmass
