#pragma once

#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"

namespace proofmass {

/// Linear loop L(s) = (ω_c/s)(1 + ω_i/s), one sample of delay.
struct DragFreeConfig {
  double bandwidth_hz = 0.05;  ///< f_c.
  double integral_hz = 0.005;  ///< f_i.
  /// Error of the read-out bias that the loop subtracts, on each axis of S, m/s².
  double bias_compensation_error_x_m_s2 = 0.0;
  double bias_compensation_error_y_m_s2 = 0.0;
  double bias_compensation_error_z_m_s2 = 0.0;
};

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
  Vector3<T> first_integral_S;   ///< Output of the first integrator, m/s².
  Vector3<T> second_integral_S;  ///< Output of the second.

  /// @param input  Γ_mes less the known bias, plus C_cal, m/s².
  /// @returns Γ_DF, the acceleration to be cancelled from the next sample on.
  PROOFMASS_INLINE Vector3<T> advance(const DragFreeGains& gains, const Vector3<T>& input_S) {
    first_integral_S += T(gains.proportional) * input_S;
    second_integral_S += T(gains.integral) * first_integral_S;
    return first_integral_S + second_integral_S;
  }
};

}  // namespace proofmass
