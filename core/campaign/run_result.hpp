#pragma once

#include <cstdint>

#include "core/campaign/identifiers.hpp"
#include "core/campaign/parameter.hpp"

namespace proofmass {

/// How a run ended. The values are stored and sent: never renumber.
enum class RunStatus : std::uint8_t {
  completed = 1,      ///< All ten estimates converged.
  not_converged = 2,  ///< Estimates are those of the last allowed round.
  not_finite = 3,     ///< The simulation or an estimate overflowed; truth holds, estimates do not.
  no_draw = 4,  ///< No draw inside the acceptance bounds was found; neither truth nor estimate.
};

/// Everything a run yields. The same bits whatever worker, thread or attempt computed it.
struct RunResult {
  RunIndex run;
  RunStatus status = RunStatus::completed;
  std::uint32_t num_draws = 0;   ///< Draws taken until one lay inside the acceptance bounds.
  std::uint32_t num_rounds = 0;  ///< Estimation rounds until no estimate moved any more.
  ParameterArray truth{};        ///< SI, from the drawn instrument's exact matrices.
  ParameterArray estimate{};     ///< SI.

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

}  // namespace proofmass
