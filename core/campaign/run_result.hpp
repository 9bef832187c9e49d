#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/result_schema.hpp"
#include "core/runs.hpp"

namespace proofmass {

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
      3,        ///< An estimate is out of range, see is_in_range(); truth holds, estimates do not.
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

/// Everything a run yields. The same bits whatever worker, thread or attempt computed it. A
/// ResultSchema says what the values are; a list is empty if its values have no meaning.
struct RunResult {
  RunIndex run;
  RunStatus status = RunStatus::completed;
  std::uint32_t num_draws = 0;     ///< Draws taken until one lay inside the acceptance bounds.
  std::uint32_t num_rounds = 0;    ///< Estimation rounds until no estimate moved any more.
  std::vector<double> truth{};     ///< Of each quantity, SI; if has_truth().
  std::vector<double> estimate{};  ///< The same, if has_estimate().
  std::vector<double> standard_error{};  ///< The same, of those quantities that have one.
  std::vector<double> health{};          ///< Of each health quantity; may be empty if has_truth().
  Loss loss{};                           ///< Says more if the status is `lost`.

  /// True if `truth` means something.
  [[nodiscard]] bool has_truth() const { return status != RunStatus::no_draw; }
  /// True if `estimate` means something.
  [[nodiscard]] bool has_estimate() const {
    return status == RunStatus::completed || status == RunStatus::not_converged;
  }
  /// estimate − truth of a quantity, SI; meaningful if has_estimate().
  [[nodiscard]] double error(std::size_t quantity) const {
    return estimate[quantity] - truth[quantity];
  }
};

/// The rules about its counts that a result breaks; no simulation yields a result that breaks one.
///
/// @param num_draws_max   Of the model's ResultSchema.
/// @param num_rounds_max  Of the campaign: Campaign::num_rounds_max().
/// @return Each as `num_draws = 0 (must be 1 to 1000 if completed)`.
[[nodiscard]] std::vector<std::string> broken_count_rules(const RunResult& result,
                                                          std::uint32_t num_draws_max,
                                                          std::int64_t num_rounds_max);

/// Statistics would be nonsense, or never end.
/// @throws Error if a truth or estimate that means something is out of range.
void require_in_range(const RunResult& result, const ResultSchema& schema);

}  // namespace proofmass
