#pragma once

#include <cmath>

#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"

namespace proofmass {

/// Unit quaternion q_AB that turns components in B into components in A: v_A = q v_B q*.
template <typename T>
struct Quaternion {
  T scalar = T(1.0);
  Vector3<T> vector{};
};

template <typename T>
PROOFMASS_INLINE Quaternion<T> operator*(const Quaternion<T>& a, const Quaternion<T>& b) {
  return {a.scalar * b.scalar - dot(a.vector, b.vector),
          a.scalar * b.vector + b.scalar * a.vector + cross(a.vector, b.vector)};
}

template <typename T>
PROOFMASS_INLINE Quaternion<T> conjugate(const Quaternion<T>& q) {
  return {q.scalar, -q.vector};
}

/// v_B = q_AB* v_A q_AB.
template <typename T>
PROOFMASS_INLINE Vector3<T> to_target(const Quaternion<T>& q_AB, const Vector3<T>& v_A) {
  const Vector3<T> twice = T(2.0) * cross(v_A, q_AB.vector);
  return v_A + q_AB.scalar * twice + cross(twice, q_AB.vector);
}

/// Rotation by a vector whose length is the angle, in radians; |angle| ≤ 0.1. The first dropped
/// terms are below 1e-17 in the vector and 1e-15 in the scalar part, and a hundredth of that at
/// 0.05.
template <typename T>
PROOFMASS_INLINE Quaternion<T> rotation_by(const Vector3<T>& rotation) {
  const T square = T(0.25) * dot(rotation, rotation);  // (angle/2)²
  const T sinc =
      T(1.0) - square * (T(1.0 / 6.0) - square * (T(1.0 / 120.0) - square * T(1.0 / 5040.0)));
  const T cosine = T(1.0) - square * (T(0.5) - square * (T(1.0 / 24.0) - square * T(1.0 / 720.0)));
  return {cosine, (T(0.5) * sinc) * rotation};
}

/// Twice the vector part: the attitude error that a star tracker reports, exact inverse of
/// from_error_angles().
template <typename T>
PROOFMASS_INLINE Vector3<T> error_angles(const Quaternion<T>& q) {
  return T(2.0) * q.vector;
}

template <typename T>
PROOFMASS_INLINE Quaternion<T> from_error_angles(const Vector3<T>& angles) {
  using std::sqrt;
  const Vector3<T> half = T(0.5) * angles;
  return {sqrt(T(1.0) - dot(half, half)), half};
}

/// One Newton step towards unit length; keeps rounding from accumulating over a session.
template <typename T>
PROOFMASS_INLINE Quaternion<T> normalised(const Quaternion<T>& q) {
  const T factor = T(1.5) - T(0.5) * (q.scalar * q.scalar + dot(q.vector, q.vector));
  return {factor * q.scalar, factor * q.vector};
}

}  // namespace proofmass
