#pragma once

#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"

namespace proofmass {

// The accelerations that grow with the distance from the satellite's centre of mass: the gravity
// gradient [T] of the Earth and the inertia gradient [In] of a turning frame ([Hardy2013] section
// 3.1). F is any one frame in which all arguments are given; the simulation calls these functions
// in S.

/// [T] v = (μ/r³)(3 û(û·v) − v), s⁻² times the unit of v. Earth is a point mass, and the next
/// order, |v|/r, is left out: 1e-10 for a test mass.
///
/// @param gradient_s2  μ/r³, for every lane the same (a double) or its own.
/// @param radial_F     û, unit vector from the Earth's centre to the satellite.
/// @param v_F          From the satellite's centre of mass to the point at which [T] acts.
template <typename T, typename Gradient>
PROOFMASS_INLINE Vector3<T> gravity_gradient(const Gradient& gradient_s2,
                                             const Vector3<T>& radial_F, const Vector3<T>& v_F) {
  const T along = T(3.0) * dot(radial_F, v_F);
  return T(gradient_s2) * (along * radial_F - v_F);
}

/// [In] v = Ω∧(Ω∧v) + Ω̇∧v, s⁻² times the unit of v; exact.
///
/// @param omega_IF_F      Ω, rad/s.
/// @param omega_dot_IF_F  Ω̇, rad/s².
template <typename T>
PROOFMASS_INLINE Vector3<T> inertia_gradient(const Vector3<T>& omega_IF_F,
                                             const Vector3<T>& omega_dot_IF_F,
                                             const Vector3<T>& v_F) {
  return cross(omega_IF_F, cross(omega_IF_F, v_F)) + cross(omega_dot_IF_F, v_F);
}

/// The matrix [T] − [In] itself, s⁻²; arguments as above. It multiplies components in F and yields
/// components in F. [In] = ΩΩᵀ − |Ω|² + [Ω̇∧], whose last part is antisymmetric.
template <typename T, typename Gradient>
PROOFMASS_INLINE Matrix3<T> gradient_matrix(const Gradient& gradient_s2, const Vector3<T>& radial_F,
                                            const Vector3<T>& omega_IF_F,
                                            const Vector3<T>& omega_dot_IF_F) {
  const T g = T(gradient_s2);
  const Vector3<T> u = (T(3.0) * g) * radial_F;
  const T diagonal = dot(omega_IF_F, omega_IF_F) - g;
  const Vector3<T>& d = radial_F;
  const Vector3<T>& w = omega_IF_F;
  const Vector3<T>& a = omega_dot_IF_F;
  const T xy = u.x * d.y - w.x * w.y;
  const T xz = u.x * d.z - w.x * w.z;
  const T yz = u.y * d.z - w.y * w.z;
  return {{{{u.x * d.x - w.x * w.x + diagonal, xy + a.z, xz - a.y},
            {xy - a.z, u.y * d.y - w.y * w.y + diagonal, yz + a.x},
            {xz + a.y, yz - a.x, u.z * d.z - w.z * w.z + diagonal}}}};
}

}  // namespace proofmass
