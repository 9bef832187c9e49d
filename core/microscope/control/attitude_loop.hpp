#pragma once

#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"

namespace proofmass {

/// Proportional-derivative loop of natural frequency f and damping ζ, with a slow integral.
struct AttitudeConfig {
  double bandwidth_hz = 0.02;
  double damping = 0.8;
  double integral_hz = 1e-3;  ///< Corner below which the integral acts.
  double blending_hz = 3e-3;  ///< Crossover from star tracker to angular accelerometer.
};

/// Gains of the attitude estimator and controller at the sample rate.
struct AttitudeGains {
  double sample_period_s = 0.0;
  double blend_angle = 0.0;        ///< 1 − r³
  double blend_rate_per_s = 0.0;   ///< (3/2)(1 − r)²(1 + r)/T
  double blend_bias_per_s2 = 0.0;  ///< (1 − r)³/T², with r = e^(−ω_h T).
  double stiffness_per_s2 = 0.0;   ///< ω²
  double damping_per_s = 0.0;      ///< 2ζω
  double integral_per_s3 = 0.0;    ///< ω²·ω_I
};

[[nodiscard]] AttitudeGains attitude_gains(const AttitudeConfig& config, double sample_period_s);

/// Hybridisation of star tracker and angular accelerometer.
///
/// The double integral of the measured acceleration is corrected by its distance from the star
/// tracker, which makes two complementary filters with a triple pole at r:
///
///     θ̂ = LP(z) θ_st + HP(z) α_mes/s²,    LP + HP = 1
///
/// LP has unit gain at rest; HP has three zeros at rest, so it removes the accelerometer's bias,
/// which the third state takes up. In continuous time LP = (3ω_h s² + 3ω_h² s + ω_h³)/(s + ω_h)³.
template <typename T>
struct AttitudeEstimator {
  Vector3<T> angle_RS_S;  ///< θ̂, error against the reference attitude, rad.
  Vector3<T> omega_RS_S;  ///< Rate against the reference, rad/s.
  Vector3<T> bias_S;      ///< Of the angular accelerometer, rad/s².

  /// Takes up the star tracker's angles of this sample.
  PROOFMASS_INLINE void correct(const AttitudeGains& gains, const Vector3<T>& star_tracker_S) {
    const Vector3<T> innovation_S = star_tracker_S - angle_RS_S;
    angle_RS_S += T(gains.blend_angle) * innovation_S;
    omega_RS_S += T(gains.blend_rate_per_s) * innovation_S;
    bias_S += T(-gains.blend_bias_per_s2) * innovation_S;
  }

  /// Carries the estimate to the next sample with the measured acceleration of this one, which acts
  /// until then.
  /// @param omega_IR_S  Ω of the rotating reference, in S.
  PROOFMASS_INLINE void predict(const AttitudeGains& gains, const Vector3<T>& omega_dot_IS_S,
                                const Vector3<T>& omega_IR_S) {
    const T period = T(gains.sample_period_s);
    const Vector3<T> corrected_S = omega_dot_IS_S - bias_S;
    const Vector3<T> mean_rate_S =
        omega_RS_S - cross(omega_IR_S, angle_RS_S) + (T(0.5) * period) * corrected_S;
    angle_RS_S += period * mean_rate_S;
    omega_RS_S += period * corrected_S;
  }
};

/// Proportional-derivative control of the estimated angle with a slow integral.
template <typename T>
struct AttitudeController {
  Vector3<T> angle_integral_S;  ///< ∫θ̂ dt, rad·s.

  /// @returns Angular acceleration to be applied from the next sample on, rad/s².
  PROOFMASS_INLINE Vector3<T> advance(const AttitudeGains& gains,
                                      const AttitudeEstimator<T>& estimate) {
    angle_integral_S += T(gains.sample_period_s) * estimate.angle_RS_S;
    return -(T(gains.stiffness_per_s2) * estimate.angle_RS_S +
             T(gains.damping_per_s) * estimate.omega_RS_S +
             T(gains.integral_per_s3) * angle_integral_S);
  }
};

}  // namespace proofmass
