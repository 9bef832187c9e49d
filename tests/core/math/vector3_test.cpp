#include "core/math/vector3.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

namespace proofmass {
namespace {

/// Numbers in [-1, 1) from a generator whose output the standard fixes.
class RandomNumbers {
 public:
  double operator()() { return static_cast<double>(bits_() >> 11) * 0x1p-52 - 1.0; }
  Vector3<double> vector() {
    const double x = (*this)();
    const double y = (*this)();
    const double z = (*this)();
    return {x, y, z};
  }
  Quaternion<double> rotation() {
    const Vector3<double> v = vector();
    const double s = (*this)();
    const double length = std::sqrt(s * s + dot(v, v));
    return {s / length, (1.0 / length) * v};
  }

 private:
  std::mt19937_64 bits_{417};
};

Eigen::Vector3d eigen(const Vector3<double>& v) { return {v.x, v.y, v.z}; }

/// R_AB of q_AB from the textbook's nine entries; v_A = R_AB v_B.
Eigen::Matrix3d matrix_of(const Quaternion<double>& q) {
  const double w = q.scalar;
  const auto& [x, y, z] = q.vector;
  Eigen::Matrix3d m;
  m << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
      2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),   //
      2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y);
  return m;
}

double distance(const Quaternion<double>& a, const Quaternion<double>& b) {
  const Vector3<double> d = a.vector - b.vector;
  return std::sqrt((a.scalar - b.scalar) * (a.scalar - b.scalar) + dot(d, d));
}

// A quarter turn about Z from A to B carries X_A into −Y_B.
TEST(Quaternion, TurnsComponentsOfTheFirstFrameIntoTheSecond) {
  const double half_root = std::sqrt(0.5);
  const Quaternion<double> q_AB{half_root, {0.0, 0.0, half_root}};
  const Vector3<double> v_B = to_target(q_AB, Vector3<double>{1.0, 0.0, 0.0});
  EXPECT_NEAR(v_B.x, 0.0, 1e-15);
  EXPECT_NEAR(v_B.y, -1.0, 1e-15);
  EXPECT_NEAR(v_B.z, 0.0, 1e-15);
}

// Some ten roundings of numbers of order one: 1e-15.
TEST(Quaternion, ToTargetIsTheTransposedMatrix) {
  RandomNumbers random;
  for (int i = 0; i < 1000; ++i) {
    const Quaternion<double> q = random.rotation();
    const Vector3<double> v = random.vector();
    const Eigen::Vector3d expected = matrix_of(q).transpose() * eigen(v);
    EXPECT_LT((eigen(to_target(q, v)) - expected).norm(), 2e-15);
  }
}

TEST(Quaternion, ProductIsTheProductOfMatrices) {
  RandomNumbers random;
  for (int i = 0; i < 1000; ++i) {
    const Quaternion<double> q_AB = random.rotation();
    const Quaternion<double> q_BC = random.rotation();
    const Eigen::Matrix3d expected = matrix_of(q_AB) * matrix_of(q_BC);
    EXPECT_LT((matrix_of(q_AB * q_BC) - expected).norm(), 5e-15);
  }
}

TEST(Quaternion, ConjugateTurnsBack) {
  RandomNumbers random;
  for (int i = 0; i < 1000; ++i) {
    const Quaternion<double> a = random.rotation();
    const Quaternion<double> b = random.rotation();
    const Vector3<double> v = random.vector();
    EXPECT_LT(distance(a * conjugate(a), Quaternion<double>{}), 1e-15);
    EXPECT_LT(distance(conjugate(a * b), conjugate(b) * conjugate(a)), 1e-15);
    EXPECT_LT((eigen(to_target(conjugate(a), to_target(a, v))) - eigen(v)).norm(), 3e-15);
  }
}

struct RotationError {
  double scalar, vector;
};

/// Errors of rotation_by() against cosine and sine of half the angle in long double.
RotationError rotation_error(double angle, const Vector3<double>& axis) {
  const Vector3<double> rotation = angle * axis;
  const Quaternion<double> actual = rotation_by(rotation);
  const long double x = rotation.x;
  const long double y = rotation.y;
  const long double z = rotation.z;
  const long double length = std::sqrt(x * x + y * y + z * z);
  const long double part = length == 0.0L ? 0.5L : std::sin(0.5L * length) / length;
  const long double vector = std::fmax(
      std::fabs(actual.vector.x - part * x),
      std::fmax(std::fabs(actual.vector.y - part * y), std::fabs(actual.vector.z - part * z)));
  return {static_cast<double>(std::fabs(actual.scalar - std::cos(0.5L * length))),
          static_cast<double>(vector)};
}

RotationError worst_rotation_error(double angle_max) {
  RandomNumbers random;
  RotationError worst = rotation_error(angle_max, {0.6, 0.0, 0.8});
  for (int i = 0; i < 20000; ++i) {
    const Vector3<double> v = random.vector();
    const Vector3<double> axis = (1.0 / std::sqrt(dot(v, v))) * v;
    const RotationError error = rotation_error(angle_max * std::fabs(random()), axis);
    worst = {std::fmax(worst.scalar, error.scalar), std::fmax(worst.vector, error.vector)};
  }
  return worst;
}

// The cosine's series ends before (angle/2)⁸/8!: 9.7e-16 at 0.1 rad, 4e-18 at 0.05 rad, beside the
// rounding of a number just below 1 (0.6e-16 to store it, as much to compute it).
TEST(RotationBy, HasTheCosineOfHalfTheAngle) {
  EXPECT_LT(worst_rotation_error(0.1).scalar, 9.7e-16 + 1.2e-16);
  EXPECT_LT(worst_rotation_error(0.05).scalar, 1.2e-16);
  EXPECT_LT(worst_rotation_error(1e-3).scalar, 1.2e-16);
  EXPECT_EQ(rotation_error(0.0, {1.0, 0.0, 0.0}).scalar, 0.0);
}

// The sine's series ends before (angle/2)⁹/9! = 5e-18; three roundings of a component of 0.05 are
// 1e-17.
TEST(RotationBy, HasTheSineOfHalfTheAngleAlongItsAxis) {
  EXPECT_LT(worst_rotation_error(0.1).vector, 1.6e-17);
  EXPECT_LT(worst_rotation_error(1e-3).vector, 1.6e-19);
  EXPECT_EQ(rotation_error(0.0, {1.0, 0.0, 0.0}).vector, 0.0);
}

TEST(RotationBy, StepsOfAConstantRateAddUpToTheWholeAngle) {
  const Vector3<double> axis{2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0};
  constexpr int num_steps = 1000;
  constexpr double step = 2e-3;
  Quaternion<double> q;
  for (int i = 0; i < num_steps; ++i) q = q * rotation_by(step * axis);
  const double half = 0.5 * step * num_steps;
  // A thousand products of four roundings each, in random directions: 1e-14 is generous.
  EXPECT_LT(distance(q, {std::cos(half), std::sin(half) * axis}), 1e-14);
}

TEST(ErrorAngles, AreInvertedByFromErrorAngles) {
  RandomNumbers random;
  for (int i = 0; i < 1000; ++i) {
    const Vector3<double> angles = 0.05 * random.vector();
    const Quaternion<double> q = from_error_angles(angles);
    EXPECT_NEAR(q.scalar * q.scalar + dot(q.vector, q.vector), 1.0, 4e-16);
    const Vector3<double> back = error_angles(q);
    EXPECT_EQ(back.x, angles.x);  // Halving and doubling are exact.
    EXPECT_EQ(back.y, angles.y);
    EXPECT_EQ(back.z, angles.z);
  }
}

TEST(Normalised, SquaresTheDefectOfLength) {
  constexpr double defect = 1e-5;
  const Quaternion<double> q{0.6 * (1.0 + defect), {0.0, 0.8 * (1.0 + defect), 0.0}};
  const Quaternion<double> unit = normalised(q);
  const double length = std::sqrt(unit.scalar * unit.scalar + dot(unit.vector, unit.vector));
  // (1 + d)(1 − d − ½d²) = 1 − (3/2)d² + O(d³)
  EXPECT_NEAR(length - 1.0, -1.5 * defect * defect, 2.0 * defect * defect * defect + 2.3e-16);
}

TEST(Vector3, CrossAndMatrixProductsFollowEigen) {
  RandomNumbers random;
  for (int i = 0; i < 100; ++i) {
    const Vector3<double> a = random.vector();
    const Vector3<double> b = random.vector();
    const Vector3<double> c = random.vector();
    const Vector3<double> v = random.vector();
    Eigen::Matrix3d m;
    m << eigen(a).transpose(), eigen(b).transpose(), eigen(c).transpose();
    EXPECT_LT((eigen(cross(a, b)) - eigen(a).cross(eigen(b))).norm(), 1e-15);
    EXPECT_LT((eigen(Matrix3<double>{{a, b, c}} * v) - m * eigen(v)).norm(), 2e-15);
  }
}

}  // namespace
}  // namespace proofmass
