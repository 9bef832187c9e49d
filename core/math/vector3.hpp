#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>

#include "core/math/inline.hpp"

namespace proofmass {

// Vectors, matrices and rotations of the sample loop. A name ends in the frame of its components,
// as core/microscope/README.md says: v_A is a vector in A, q_AB the rotation between A and B.

/// A vector over the number type of a kernel: `double` for one run, a batch of lanes for many.
/// Eigen serves wherever a single run is set up; this type is what the sample loop is written in.
template <typename T>
struct Vector3 {
  T x{};
  T y{};
  T z{};

  PROOFMASS_INLINE T& operator[](std::size_t i) { return i == 0 ? x : (i == 1 ? y : z); }
  PROOFMASS_INLINE const T& operator[](std::size_t i) const {
    return i == 0 ? x : (i == 1 ? y : z);
  }
};

template <typename T>
PROOFMASS_INLINE Vector3<T> operator+(const Vector3<T>& a, const Vector3<T>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <typename T>
PROOFMASS_INLINE Vector3<T> operator-(const Vector3<T>& a, const Vector3<T>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <typename T>
PROOFMASS_INLINE Vector3<T> operator-(const Vector3<T>& a) {
  return {-a.x, -a.y, -a.z};
}
template <typename T, typename S>
PROOFMASS_INLINE Vector3<T> operator*(const S& s, const Vector3<T>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <typename T>
PROOFMASS_INLINE Vector3<T>& operator+=(Vector3<T>& a, const Vector3<T>& b) {
  return a = a + b;
}

template <typename T>
PROOFMASS_INLINE T dot(const Vector3<T>& a, const Vector3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <typename T>
PROOFMASS_INLINE Vector3<T> cross(const Vector3<T>& a, const Vector3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Componentwise product: a diagonal matrix times a vector.
template <typename T>
PROOFMASS_INLINE Vector3<T> scaled(const Vector3<T>& a, const Vector3<T>& b) {
  return {a.x * b.x, a.y * b.y, a.z * b.z};
}

// Functions of a number. Each has a twin over the number type of a batch.

PROOFMASS_INLINE double square_root(double a) { return __builtin_sqrt(a); }

// For the extremes of a run.

/// |a|, and the larger or smaller of two numbers: `b` if `a` is not a number, as vector
/// instructions have it.
PROOFMASS_INLINE double magnitude(double a) { return std::abs(a); }
PROOFMASS_INLINE double larger(double a, double b) { return a > b ? a : b; }
PROOFMASS_INLINE double smaller(double a, double b) { return a < b ? a : b; }
/// True if the number of any lane is above a limit.
PROOFMASS_INLINE bool is_any_above(double a, double limit) { return a > limit; }

/// Largest magnitude of a vector's elements and `most`; elements that are not numbers are passed
/// over.
template <typename T>
PROOFMASS_INLINE T largest_magnitude(const Vector3<T>& a, const T& most) {
  return larger(magnitude(a.x), larger(magnitude(a.y), larger(magnitude(a.z), most)));
}
/// The limit in each lane whose number is above it, no limit in the others.
PROOFMASS_INLINE double limit_where_above(double a, double limit) {
  return a > limit ? limit : std::numeric_limits<double>::infinity();
}
/// Each element cut off at ±limit; what is not a number stays.
template <typename T>
PROOFMASS_INLINE Vector3<T> clamped(const Vector3<T>& a, const T& limit) {
  const T bottom = -limit;
  const auto clamp = [&](const T& x) { return larger(bottom, smaller(limit, x)); };
  return {clamp(a.x), clamp(a.y), clamp(a.z)};
}

/// A vector that is the same for every lane.
template <typename T>
PROOFMASS_INLINE Vector3<T> broadcast(const Vector3<double>& a) {
  return {T(a.x), T(a.y), T(a.z)};
}
/// One of which each lane has its own already.
template <typename T>
requires(!std::same_as<T, double>)
    PROOFMASS_INLINE const Vector3<T>& broadcast(const Vector3<T>& a) {
  return a;
}

/// A 3 × 3 matrix, rows first.
template <typename T>
struct Matrix3 {
  std::array<Vector3<T>, 3> row;
};

template <typename T>
PROOFMASS_INLINE Vector3<T> operator*(const Matrix3<T>& m, const Vector3<T>& v) {
  return {dot(m.row[0], v), dot(m.row[1], v), dot(m.row[2], v)};
}

/// Unit quaternion q_AB that turns components in B into components in A: v_A = q v_B q*. Products
/// cancel the inner frame: q_AC = q_AB q_BC. Without rotation by default.
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

/// q_BA of q_AB.
template <typename T>
PROOFMASS_INLINE Quaternion<T> conjugate(const Quaternion<T>& q) {
  return {q.scalar, -q.vector};
}

/// v_B = q_AB* v_A q_AB: the components of a vector in the frame that q_AB leads to.
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

/// The rotation with these error angles, rad; each below 2.
template <typename T>
PROOFMASS_INLINE Quaternion<T> from_error_angles(const Vector3<T>& angles) {
  const Vector3<T> half = T(0.5) * angles;
  return {square_root(T(1.0) - dot(half, half)), half};
}

/// One Newton step towards unit length; keeps rounding from accumulating over a session.
template <typename T>
PROOFMASS_INLINE Quaternion<T> normalised(const Quaternion<T>& q) {
  const T factor = T(1.5) - T(0.5) * (q.scalar * q.scalar + dot(q.vector, q.vector));
  return {factor * q.scalar, factor * q.vector};
}

}  // namespace proofmass
