#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/identifiers.hpp"
#include "core/campaign/loop_health.hpp"
#include "core/campaign/parameter.hpp"

namespace proofmass {

/// What is larger than any truth or estimate, SI: cubes of errors can be added up over any number
/// of runs.
inline constexpr double magnitude_max = 1e90;

/// False for infinities and NaN, too.
[[nodiscard]] inline bool is_in_range(double value) { return std::abs(value) <= magnitude_max; }

/// How a run ended. The values are stored and sent: never renumber.
enum class RunStatus : std::uint8_t {
  completed = 1,      ///< All ten estimates converged.
  not_converged = 2,  ///< Estimates are those of the last allowed round.
  not_finite =
      3,        ///< An estimate is out of range, see is_in_range(); truth holds, estimates do not.
  no_draw = 4,  ///< No draw inside the acceptance bounds was found; neither truth nor estimate.
  lost = 5,     ///< A loop or a sensor left its limits, see Loss; truth holds, estimates do not.
};

/// `not_converged`, for people and files.
[[nodiscard]] std::string_view name_of(RunStatus status);

/// Everything a run yields. The same bits whatever worker, thread or attempt computed it.
struct RunResult {
  RunIndex run;
  RunStatus status = RunStatus::completed;
  std::uint32_t num_draws = 0;   ///< Draws taken until one lay inside the acceptance bounds.
  std::uint32_t num_rounds = 0;  ///< Estimation rounds until no estimate moved any more.
  ParameterArray truth{};        ///< SI, from the drawn instrument's exact matrices.
  ParameterArray estimate{};     ///< SI.
  /// Nothing if has_truth() does not hold.
  std::optional<LoopHealth> health{};
  Loss loss{};  ///< Says more if the status is `lost`, nothing otherwise.

  /// True if `truth` means something.
  [[nodiscard]] bool has_truth() const { return status != RunStatus::no_draw; }
  /// True if `estimate` means something.
  [[nodiscard]] bool has_estimate() const {
    return status == RunStatus::completed || status == RunStatus::not_converged;
  }
  /// estimate − truth, SI; meaningful if has_estimate().
  [[nodiscard]] double error(Parameter parameter) const {
    return estimate[index(parameter)] - truth[index(parameter)];
  }
};

/// Most draws of one run; with the nominal laws three of four are accepted. Then: no_draw.
inline constexpr std::uint32_t num_draws_max = 1000;

/// The rules about its counts that a result breaks; no simulation yields a result that breaks one.
///
/// @param num_rounds_max  Of the scenario: EstimationConfig::num_rounds_max.
/// @return Each as `num_draws = 0 (must be 1 to 1000 if completed)`.
[[nodiscard]] std::vector<std::string> broken_count_rules(const RunResult& result,
                                                          std::int64_t num_rounds_max);

/// Statistics would be nonsense, or never end.
/// @throws Error if a truth or estimate that means something is out of range.
void require_in_range(const RunResult& result);

}  // namespace proofmass
