#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "core/math/inline.hpp"

namespace proofmass {

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
/// Componentwise product.
template <typename T>
PROOFMASS_INLINE Vector3<T> scaled(const Vector3<T>& a, const Vector3<T>& b) {
  return {a.x * b.x, a.y * b.y, a.z * b.z};
}
/// |a|, and the larger of two numbers: `b` if `a` is not a number, as vector instructions have it.
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

/// The same number for every lane.
template <typename T>
PROOFMASS_INLINE Vector3<T> broadcast(const Vector3<double>& a) {
  return {T(a.x), T(a.y), T(a.z)};
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

}  // namespace proofmass
