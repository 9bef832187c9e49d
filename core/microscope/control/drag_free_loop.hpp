#pragma once

#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"
#include "core/microscope/campaign/scenario.hpp"

namespace proofmass {

/// Gains of the linear loop at the sample rate.
struct DragFreeGains {
  double proportional = 0.0;  ///< ω_c T.
  double integral = 0.0;      ///< ω_i T.
};

[[nodiscard]] DragFreeGains drag_free_gains(const DragFreeConfig& config, double sample_period_s);

/// Controller of the linear drag-free loop, each axis alone: (ω_c/s)(1 + ω_i/s) with s replaced by
/// (1 − z⁻¹)/T. Thrust is proportional to acceleration, so the controller supplies all the
/// dynamics:
///
///     L(z) = z⁻¹ · ω_cT/(1 − z⁻¹) · (1 + ω_iT/(1 − z⁻¹))
///
/// where z⁻¹ is the sample that passes until the command acts.
template <typename T>
struct DragFreeController {
  Vector3<T> first;   ///< Output of the first integrator, m/s².
  Vector3<T> second;  ///< Output of the second.

  /// @param input  Γ_mes less the known bias, plus C_cal, m/s².
  /// @returns Γ_DF, the acceleration to be cancelled from the next sample on.
  PROOFMASS_INLINE Vector3<T> advance(const DragFreeGains& gains, const Vector3<T>& input) {
    first += T(gains.proportional) * input;
    second += T(gains.integral) * first;
    return first + second;
  }
};

}  // namespace proofmass
