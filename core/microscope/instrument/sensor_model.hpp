#pragma once

#include <array>

#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"
#include "core/microscope/instrument/instrument.hpp"
#include "core/microscope/orbit/gradient.hpp"

namespace proofmass {

/// What is the same for all sensors.
struct SensorConfig {
  /// Largest acceleration that a sensor reports on an axis, m/s²; a larger one reads as this.
  double range_m_s2 = 1e-5;
};

/// Satellite motion that both test masses feel, in S.
template <typename T>
struct SatelliteMotion {
  Vector3<T> acceleration_S;  ///< Γ_sat: non-gravitational acceleration of O_sat, m/s².
  double gradient_s2 = 0.0;   ///< μ/r³.
  Vector3<T> radial_S;        ///< û_S: from the Earth to the satellite.
  Vector3<T> omega_IS_S;      ///< Ω, rad/s.
  Vector3<T> omega_dot_IS_S;  ///< Ω̇, rad/s².
};

/// Factors of the motion q(t) = direction·(position, velocity, acceleration) of a test mass.
struct MassMotionPhase {
  double position_m = 0.0;
  double velocity_m_s = 0.0;
  double acceleration_m_s2 = 0.0;
};

/// Constants of a sensor and its mass, in S unless said otherwise.
template <typename T>
struct SensorModel {
  Vector3<T> rest_position_S_m;   ///< r_k without excitation: from O_sat to O_k.
  Vector3<T> motion_direction_S;  ///< [θ_k]ᵀ e_a s_k.
  Vector3<T> parasitic_K_m_s2;    ///< p_k.
  Vector3<T> offset_K_m_s2;       ///< b0_k − ([K1_k] + [η_k]) p_k.
  Matrix3<T> sensitivity_KS;      ///< [M_k].
  Vector3<T> quadratic_s2_m;      ///< [K2_k].
};

/// Γ_App,k + p_k, the applied acceleration without the parasitic one ([Hardy2013]
/// eq:instrument-dynamics with O_kO_sat = −r_k): Γ_sat − ([T] − [In]) r + [Cor] ṙ + r̈.
template <typename T>
PROOFMASS_INLINE Vector3<T> kinematic_acceleration(const SensorModel<T>& sensor,
                                                   const SatelliteMotion<T>& satellite,
                                                   const MassMotionPhase& motion) {
  const Vector3<T> r_S =
      sensor.rest_position_S_m + T(motion.position_m) * sensor.motion_direction_S;
  const Vector3<T> velocity_S = T(motion.velocity_m_s) * sensor.motion_direction_S;
  const Vector3<T> acceleration_S = T(motion.acceleration_m_s2) * sensor.motion_direction_S;
  return satellite.acceleration_S -
         gravity_gradient(satellite.gradient_s2, satellite.radial_S, r_S) +
         inertia_gradient(satellite.omega_IS_S, satellite.omega_dot_IS_S, r_S) +
         T(2.0) * cross(satellite.omega_IS_S, velocity_S) + acceleration_S;
}

/// Γ_mes,k without noise ([Hardy2013] eq:measurement):
/// b0 + [M](Γ_App + p) − ([K1] + [η]) p + [K2] Γ_App².
template <typename T>
PROOFMASS_INLINE Vector3<T> measured_acceleration(const SensorModel<T>& sensor,
                                                  const Vector3<T>& kinematic_S) {
  const Vector3<T> applied = kinematic_S - sensor.parasitic_K_m_s2;
  return sensor.offset_K_m_s2 + sensor.sensitivity_KS * kinematic_S +
         scaled(sensor.quadratic_s2_m, scaled(applied, applied));
}

}  // namespace proofmass
