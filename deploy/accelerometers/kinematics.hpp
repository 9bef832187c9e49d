#pragma once

#include <cmath>

#include "core/math/vector3.hpp"

namespace proofmass {

/// n of a circular orbit.
[[nodiscard]] inline double orbit_rate_rad_s(double altitude_m) {
  const double radius_m = 6378137.0 + altitude_m;
  return std::sqrt(3.986004418e14 / radius_m) / radius_m;
}

/// Angular motion of the satellite in its frame: x along track, y across track, z to the Earth.
struct Rotation {
  Vector3<double> rate_rad_s;           ///< ω
  Vector3<double> acceleration_rad_s2;  ///< ω̇
  Vector3<double> angle_rad;            ///< Of the satellite from the orbit's frame, small.
};

/// What a place r in the satellite has as acceleration more than the origin, per metre of r:
///
///     G = −V + Ω² + Ω̇,   Ω = [ω×],   Ω² = ωωᵀ − |ω|² I
///
/// V is the gravity gradient of a point mass on a circular orbit, n² diag(−1, −1, 2), turned by
/// small angles to first order, V ← V + VΘ − ΘV with Θ = [θ×].
///
/// @param orbit_rate_rad_s  n > 0.
[[nodiscard]] inline Matrix3<double> acceleration_gradient(const Rotation& rotation,
                                                           double orbit_rate_rad_s) {
  const double n2 = orbit_rate_rad_s * orbit_rate_rad_s;
  const Vector3<double>& w = rotation.rate_rad_s;
  const Vector3<double>& a = rotation.acceleration_rad_s2;
  const double v_xz = -3.0 * n2 * rotation.angle_rad.y, v_yz = 3.0 * n2 * rotation.angle_rad.x;
  return {{{{n2 - w.y * w.y - w.z * w.z, w.x * w.y - a.z, w.x * w.z + a.y - v_xz},
            {w.x * w.y + a.z, n2 - w.x * w.x - w.z * w.z, w.y * w.z - a.x - v_yz},
            {w.x * w.z - a.y - v_xz, w.y * w.z + a.x - v_yz, -2.0 * n2 - w.x * w.x - w.y * w.y}}}};
}

/// An accelerometer as it is, or as it is estimated.
struct Accelerometer {
  Matrix3<double> matrix;     ///< M
  Vector3<double> quadratic;  ///< Diagonal of K, s²/m.
  Matrix3<double> coupling;   ///< W, m.
  Vector3<double> place_m;    ///< r
};

/// What it reads without its noise, m/s²:
///
///     a = G r + a_ng,    y = M a + K (a ∘ a) + W ω̇
///
/// @param gradient  G.
[[nodiscard]] inline Vector3<double> reading(const Accelerometer& sensor,
                                             const Vector3<double>& a_ng_m_s2,
                                             const Matrix3<double>& gradient,
                                             const Vector3<double>& angular_rad_s2) {
  const Vector3<double> a = gradient * sensor.place_m + a_ng_m_s2;
  return sensor.matrix * a + scaled(sensor.quadratic, scaled(a, a)) +
         sensor.coupling * angular_rad_s2;
}

}  // namespace proofmass
