#pragma once

#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"

namespace proofmass {

/// [T] v = (μ/r³)(3 û(û·v) − v): the Earth's gravity gradient at first order ([Hardy2013]
/// section 3.1).
/// @param gradient_s2  μ/r³, the same for every lane.
/// @param direction    û, in the frame of v.
template <typename T>
PROOFMASS_INLINE Vector3<T> gravity_gradient(double gradient_s2, const Vector3<T>& direction,
                                             const Vector3<T>& v) {
  const T along = T(3.0) * dot(direction, v);
  return T(gradient_s2) * (along * direction - v);
}

/// [In] v = Ω∧(Ω∧v) + Ω̇∧v ([Hardy2013] section 3.1).
template <typename T>
PROOFMASS_INLINE Vector3<T> inertia_gradient(const Vector3<T>& rate, const Vector3<T>& acceleration,
                                             const Vector3<T>& v) {
  return cross(rate, cross(rate, v)) + cross(acceleration, v);
}

/// The matrix [T] − [In] itself.
template <typename T>
PROOFMASS_INLINE Matrix3<T> gradient_matrix(double gradient_s2, const Vector3<T>& direction,
                                            const Vector3<T>& rate,
                                            const Vector3<T>& acceleration) {
  const T g = T(gradient_s2);
  const Vector3<T> u = (T(3.0) * g) * direction;
  // In = ΩΩᵀ − Ω² + [Ω̇∧]
  const T diagonal = dot(rate, rate) - g;
  const Vector3<T>& d = direction;
  const Vector3<T>& w = rate;
  const Vector3<T>& a = acceleration;
  const T xy = u.x * d.y - w.x * w.y;
  const T xz = u.x * d.z - w.x * w.z;
  const T yz = u.y * d.z - w.y * w.z;
  return {{{{u.x * d.x - w.x * w.x + diagonal, xy + a.z, xz - a.y},
            {xy - a.z, u.y * d.y - w.y * w.y + diagonal, yz + a.x},
            {xz + a.y, yz - a.x, u.z * d.z - w.z * w.z + diagonal}}}};
}

}  // namespace proofmass
