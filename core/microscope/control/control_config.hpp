#pragma once

namespace proofmass {

/// Settings of the drag-free loop L(s) = (ω_c/s)(1 + ω_i/s): `[drag_free]` of a campaign file.
struct DragFreeConfig {
  double bandwidth_hz = 0.05;  ///< f_c = ω_c/2π, at which |L| is about 1.
  double integral_hz = 0.005;  ///< f_i = ω_i/2π, below which L grows with 1/f²; < bandwidth_hz.
  /// ζ of the resonator at f_EP that the loop has in sessions that test; 0: it has none.
  double resonator_damping = 0.0;
  /// Error of the read-out bias that the loop subtracts, on each axis of S: C_0 − b_0c of
  /// [Hardy2013] section 4.2.
  double bias_compensation_error_x_m_s2 = 0.0;
  double bias_compensation_error_y_m_s2 = 0.0;
  double bias_compensation_error_z_m_s2 = 0.0;
};

/// Settings of the attitude loop, proportional and derivative with a slow integral: `[attitude]` of
/// a campaign file.
struct AttitudeConfig {
  double bandwidth_hz = 0.02;  ///< Natural frequency ω/2π.
  double damping = 0.8;        ///< Damping ratio ζ.
  double integral_hz = 1e-3;   ///< Corner below which the integral acts; < bandwidth_hz.
  double blending_hz = 3e-3;   ///< Crossover ω_h/2π from star tracker to angular accelerometer.
};

}  // namespace proofmass
