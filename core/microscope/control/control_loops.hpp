#pragma once

#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"
#include "core/microscope/control/control_config.hpp"

namespace proofmass {

// The two control loops of the satellite, sampled. What a controller returns at sample k acts from
// sample k + 1 on. README.md has the transfer functions.

/// Gains of the drag-free loop at the sample rate, without unit.
struct DragFreeGains {
  double proportional = 0.0;  ///< ω_c T.
  double integral = 0.0;      ///< ω_i T.
};

[[nodiscard]] DragFreeGains drag_free_gains(const DragFreeConfig& config, double sample_period_s);

/// Controller of the drag-free loop, each axis by itself: (ω_c/s)(1 + ω_i/s) with s replaced by
/// (1 − z⁻¹)/T. Thrust is proportional to acceleration, so the controller supplies all the
/// dynamics:
///
///     L(z) = z⁻¹ · ω_cT/(1 − z⁻¹) · (1 + ω_iT/(1 − z⁻¹))
///
/// where z⁻¹ is the sample that passes until the command acts.
template <typename T>
struct DragFreeController {
  Vector3<T> first_integral_S;   ///< Output of the first integrator, m/s².
  Vector3<T> second_integral_S;  ///< Output of the second, m/s².

  /// @param input_S  Γ_mes less the known bias, plus C_cal, m/s². The measurement's components, in
  ///                 the sensors' frames, are taken for those in S: a misalignment of 2.5 mrad is
  ///                 a coupling between the axes of the loop.
  /// @returns Γ_DF, m/s²: the acceleration to be cancelled from the next sample on.
  PROOFMASS_INLINE Vector3<T> advance(const DragFreeGains& gains, const Vector3<T>& input_S) {
    first_integral_S += T(gains.proportional) * input_S;
    second_integral_S += T(gains.integral) * first_integral_S;
    return first_integral_S + second_integral_S;
  }
};

/// Gains of a resonator at the sample rate, without unit.
struct ResonatorGains {
  double cosine = 1.0;  ///< cos ω_0T.
  double sine = 0.0;    ///< sin ω_0T.
  double input = 0.0;   ///< 2ζω_0T; 0: no resonator.
};

/// @param damping       ζ: what is left of a line at ω_0 decays as e^(−ζω_0 t).
/// @param frequency_hz  ω_0/2π.
[[nodiscard]] ResonatorGains resonator_gains(double damping, double frequency_hz,
                                             double sample_period_s);

/// Makes the drag-free loop reject one line altogether: its input, on each axis by itself, times
///
///     1 + 2ζω_0 s/(s² + ω_0²),    here 1 + 2ζω_0T (1 − z⁻¹ cos ω_0T)/(1 − 2z⁻¹ cos ω_0T + z⁻²)
///
/// The loop's gain is infinite at ω_0, so its sensitivity 1/(1 + L) is 0 there. Where |L| without
/// the resonator is far above 1, the zeros of this factor are poles of the closed loop.
template <typename T>
struct Resonator {
  Vector3<T> in_phase_S;    ///< m/s².
  Vector3<T> quadrature_S;  ///< A quarter of a turn behind, m/s².

  /// @param input_S  What DragFreeController::advance() would be given, m/s².
  /// @returns What it is given instead.
  PROOFMASS_INLINE Vector3<T> advance(const ResonatorGains& gains, const Vector3<T>& input_S) {
    if (gains.input == 0.0) return input_S;
    const T cosine = T(gains.cosine), sine = T(gains.sine);
    const Vector3<T> turned_S = cosine * in_phase_S - sine * quadrature_S;
    quadrature_S = sine * in_phase_S + cosine * quadrature_S;
    in_phase_S = turned_S + T(gains.input) * input_S;
    return input_S + in_phase_S;
  }
};

/// Gains of the attitude estimator and controller at the sample rate.
struct AttitudeGains {
  double sample_period_s = 0.0;    ///< T.
  double blend_angle = 0.0;        ///< 1 − r³, with r = e^(−ω_h T).
  double blend_rate_per_s = 0.0;   ///< (3/2)(1 − r)²(1 + r)/T.
  double blend_bias_per_s2 = 0.0;  ///< (1 − r)³/T².
  double stiffness_per_s2 = 0.0;   ///< ω².
  double damping_per_s = 0.0;      ///< 2ζω.
  double integral_per_s3 = 0.0;    ///< ω²·ω_I.
};

[[nodiscard]] AttitudeGains attitude_gains(const AttitudeConfig& config, double sample_period_s);

/// Estimates the attitude against the reference R from star tracker and angular accelerometer (the
/// paper's hybridisation, [Hardy2013] section 5.1).
///
/// The double integral of the measured acceleration is corrected by its distance from the star
/// tracker, which makes two complementary filters with a triple pole at r:
///
///     θ̂ = LP(z) θ_st + HP(z) α_mes/s²,    LP + HP = 1
///
/// LP has unit gain at rest; HP has three zeros at rest, so it removes the accelerometer's bias,
/// which the third state takes up. In continuous time LP = (3ω_h s² + 3ω_h² s + ω_h³)/(s + ω_h)³.
/// The angles are small: R and S are told apart in first order only.
template <typename T>
struct AttitudeEstimator {
  Vector3<T> angle_RS_S;  ///< θ̂: rotation vector from the reference to the satellite, rad.
  Vector3<T> omega_RS_S;  ///< Its rate: Ω less that of the reference, rad/s.
  Vector3<T> bias_S;      ///< Estimated bias of the angular accelerometer, rad/s².

  /// Takes up the star tracker's angles of this sample, rad.
  PROOFMASS_INLINE void correct(const AttitudeGains& gains, const Vector3<T>& star_tracker_RS_S) {
    const Vector3<T> innovation_S = star_tracker_RS_S - angle_RS_S;
    angle_RS_S += T(gains.blend_angle) * innovation_S;
    omega_RS_S += T(gains.blend_rate_per_s) * innovation_S;
    bias_S += T(-gains.blend_bias_per_s2) * innovation_S;
  }

  /// Carries the estimate to the next sample with the acceleration that was measured at this one
  /// and acts until then. The reference turns at a constant rate, so that Ω̇_RS = Ω̇_IS.
  ///
  /// @param omega_dot_IS_S  Measured Ω̇, rad/s².
  /// @param omega_IR_S      Ω of the reference, rad/s. Its components in R will do.
  PROOFMASS_INLINE void predict(const AttitudeGains& gains, const Vector3<T>& omega_dot_IS_S,
                                const Vector3<T>& omega_IR_S) {
    const T period = T(gains.sample_period_s);
    const Vector3<T> omega_dot_RS_S = omega_dot_IS_S - bias_S;
    const Vector3<T> mean_rate_S =
        omega_RS_S - cross(omega_IR_S, angle_RS_S) + (T(0.5) * period) * omega_dot_RS_S;
    angle_RS_S += period * mean_rate_S;
    omega_RS_S += period * omega_dot_RS_S;
  }
};

/// Proportional-derivative control of the estimated angle with a slow integral.
template <typename T>
struct AttitudeController {
  Vector3<T> angle_integral_S;  ///< ∫θ̂ dt, rad·s.

  /// @returns Angular acceleration in S to be applied from the next sample on, rad/s².
  PROOFMASS_INLINE Vector3<T> advance(const AttitudeGains& gains,
                                      const AttitudeEstimator<T>& estimate) {
    angle_integral_S += T(gains.sample_period_s) * estimate.angle_RS_S;
    return -(T(gains.stiffness_per_s2) * estimate.angle_RS_S +
             T(gains.damping_per_s) * estimate.omega_RS_S +
             T(gains.integral_per_s3) * angle_integral_S);
  }
};

}  // namespace proofmass
