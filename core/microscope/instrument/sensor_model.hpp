#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"
#include "core/microscope/instrument/instrument.hpp"
#include "core/microscope/instrument/instrument_config.hpp"
#include "core/microscope/orbit/gradient.hpp"

namespace proofmass {

// One sensor with its mass in the sample loop, over the number type of the kernel. k is the sensor,
// 1 or 2, K its frame.

/// Satellite motion that both test masses feel at one sample.
template <typename T>
struct SatelliteMotion {
  Vector3<T> acceleration_S;  ///< Γ_sat: non-gravitational acceleration of O_sat, m/s².
  T gradient_s2{};            ///< μ/r³.
  Vector3<T> radial_S;        ///< û: unit vector from the Earth's centre to the satellite.
  Vector3<T> omega_IS_S;      ///< Ω, rad/s.
  Vector3<T> omega_dot_IS_S;  ///< Ω̇, rad/s².
};

/// How many motions of the test masses a session commands. The terms of others are not computed.
enum class TestMasses : std::uint8_t { at_rest, moving, moving_twice };

/// Factors of the motion q_S(t) = motion_direction_S·(position, velocity, acceleration) that a
/// session commands of a test mass. All are 0 where no mass moves.
template <typename T>
struct MassMotionPhaseOf {
  T position_m{};         ///< Δ_TM sin(2π f t).
  T velocity_m_s{};       ///< Its first derivative.
  T acceleration_m_s2{};  ///< Its second.
};
using MassMotionPhase = MassMotionPhaseOf<double>;

/// Constants of a sensor and its mass during a session.
template <typename T>
struct SensorModel {
  Vector3<T> rest_position_S_m;  ///< r_k without excitation: from O_sat to O_k.
  Vector3<T> motion_direction_S;  ///< [θ_k]ᵀ e_a s_k: an axis of K in S; 0 if the mass is at rest.
  Vector3<T> second_direction_S;  ///< That of the second motion.
  Vector3<T> parasitic_K_m_s2;    ///< p_k.
  Vector3<T> offset_K_m_s2;       ///< b0_k − ([K1_k] + [η_k]) p_k: all that is constant.
  Matrix3<T> sensitivity_KS;      ///< [M_k].
  Vector3<T> quadratic_s2_m;      ///< K2 of each axis of K.
};

/// Γ_App,k + p_k in S, m/s²: the applied acceleration without the parasitic one ([Hardy2013]
/// eq:instrument-dynamics with O_kO_sat = −r_k): Γ_sat − ([T] − [In]) r + [Cor] ṙ + r̈. The mass
/// follows the session's command exactly, as the sensor's own loop is far faster.
///
/// @tparam masses  `at_rest` only with motions that are 0, `moving` only with a second one that is;
///                 then it makes no difference to the value.
template <TestMasses masses = TestMasses::moving_twice, typename T, typename Shared>
PROOFMASS_INLINE Vector3<T> kinematic_acceleration(const SensorModel<T>& sensor,
                                                   const SatelliteMotion<T>& satellite,
                                                   const MassMotionPhaseOf<Shared>& motion,
                                                   const MassMotionPhaseOf<Shared>& second = {}) {
  Vector3<T> r_S = sensor.rest_position_S_m;
  if constexpr (masses != TestMasses::at_rest) {
    r_S += T(motion.position_m) * sensor.motion_direction_S;
  }
  if constexpr (masses == TestMasses::moving_twice) {
    r_S += T(second.position_m) * sensor.second_direction_S;
  }
  const Vector3<T> at_rest_S =
      satellite.acceleration_S - gravity_gradient(satellite.gradient_s2, satellite.radial_S, r_S) +
      inertia_gradient(satellite.omega_IS_S, satellite.omega_dot_IS_S, r_S);
  if constexpr (masses == TestMasses::at_rest) return at_rest_S;
  Vector3<T> velocity_S = T(motion.velocity_m_s) * sensor.motion_direction_S;
  Vector3<T> acceleration_S = T(motion.acceleration_m_s2) * sensor.motion_direction_S;
  if constexpr (masses == TestMasses::moving_twice) {
    velocity_S += T(second.velocity_m_s) * sensor.second_direction_S;
    acceleration_S += T(second.acceleration_m_s2) * sensor.second_direction_S;
  }
  return at_rest_S + T(2.0) * cross(satellite.omega_IS_S, velocity_S) + acceleration_S;
}

/// What a violation of the equivalence principle adds to Γ_App,k in S, m/s²: ½ δ g(O_sat) for
/// sensor 1 and the opposite for sensor 2, so that Γ_App,d holds ½ δ g ([Hardy2013] section 3.2).
///
/// @param eotvos_parameter  δ.
/// @param gravity_m_s2      |g| at O_sat; g = −|g| û.
template <typename T>
PROOFMASS_INLINE Vector3<T> violation_acceleration(std::size_t k, const T& eotvos_parameter,
                                                   double gravity_m_s2,
                                                   const Vector3<T>& radial_S) {
  return (T(k == 0 ? -0.5 : 0.5) * T(gravity_m_s2) * eotvos_parameter) * radial_S;
}

/// Γ_mes,k in K without noise, m/s² ([Hardy2013] eq:measurement):
/// b0 + [M](Γ_App + p) − ([K1] + [η]) p + [K2] Γ_App².
///
/// Γ_App is computed as the difference of a vector in S and one in K. It enters through K2 alone, a
/// small term of which turning p by θ would change a part in 400.
///
/// @param kinematic_S  kinematic_acceleration().
template <typename T>
PROOFMASS_INLINE Vector3<T> measured_acceleration(const SensorModel<T>& sensor,
                                                  const Vector3<T>& kinematic_S) {
  const Vector3<T> applied = kinematic_S - sensor.parasitic_K_m_s2;
  return sensor.offset_K_m_s2 + sensor.sensitivity_KS * kinematic_S +
         scaled(sensor.quadratic_s2_m, scaled(applied, applied));
}

}  // namespace proofmass
