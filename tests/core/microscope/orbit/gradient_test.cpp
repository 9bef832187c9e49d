#include "core/microscope/orbit/gradient.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

namespace proofmass {
namespace {

constexpr double gradient_s2 = 1.115e-6;  // n² of the nominal orbit.

struct Motion {
  Vector3<double> direction, rate, acceleration, v;
};

/// Directions on the unit sphere; rates of 1e-3 rad/s, so that [In] is as large as [T].
Motion random_motion(std::mt19937_64& bits) {
  const auto number = [&bits] { return static_cast<double>(bits() >> 11) * 0x1p-52 - 1.0; };
  const auto vector = [&number](double scale) {
    const double x = scale * number();
    const double y = scale * number();
    const double z = scale * number();
    return Vector3<double>{x, y, z};
  };
  Motion motion{vector(1.0), vector(1e-3), vector(1e-6), vector(1.0)};
  motion.direction = (1.0 / std::sqrt(dot(motion.direction, motion.direction))) * motion.direction;
  return motion;
}

Eigen::Vector3d eigen(const Vector3<double>& v) { return {v.x, v.y, v.z}; }

/// [a∧]: [a∧] v = a × v.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& a) {
  Eigen::Matrix3d m;
  m << 0.0, -a.z(), a.y(),  //
      a.z(), 0.0, -a.x(),   //
      -a.y(), a.x(), 0.0;
  return m;
}

Eigen::Matrix3d gravity_matrix(const Motion& motion) {
  const Eigen::Vector3d u = eigen(motion.direction);
  return gradient_s2 * (3.0 * u * u.transpose() - Eigen::Matrix3d::Identity());
}

Eigen::Matrix3d inertia_matrix(const Motion& motion) {
  const Eigen::Matrix3d rate = cross_matrix(eigen(motion.rate));
  return rate * rate + cross_matrix(eigen(motion.acceleration));
}

Eigen::Matrix3d eigen(const Matrix3<double>& m) {
  Eigen::Matrix3d result;
  result << eigen(m.row[0]).transpose(), eigen(m.row[1]).transpose(), eigen(m.row[2]).transpose();
  return result;
}

// Ten roundings of terms of a few 1e-6 s⁻².
constexpr double tolerance = 5e-21;

TEST(GravityGradient, IsTheFirstOrderOfTheCentralField) {
  std::mt19937_64 bits(8);
  for (int i = 0; i < 1000; ++i) {
    const Motion m = random_motion(bits);
    const Eigen::Vector3d actual = eigen(gravity_gradient(gradient_s2, m.direction, m.v));
    EXPECT_LT((actual - gravity_matrix(m) * eigen(m.v)).norm(), tolerance);
  }
}

// g(r + v) − g(r) for g = −μ r/r³ at r = a û, in long double: second order leaves 6 |v|/a.
TEST(GravityGradient, IsTheDifferenceOfTwoAttractions) {
  std::mt19937_64 bits(9);
  for (int i = 0; i < 100; ++i) {
    const Motion m = random_motion(bits);
    constexpr long double a = 1e6L;  // In units of v.
    const auto attraction = [](const Eigen::Matrix<long double, 3, 1>& r) {
      const long double length = r.norm();
      return Eigen::Matrix<long double, 3, 1>(-r / (length * length * length));
    };
    const Eigen::Matrix<long double, 3, 1> r = a * eigen(m.direction).cast<long double>();
    const Eigen::Matrix<long double, 3, 1> v = eigen(m.v).cast<long double>();
    const Eigen::Vector3d difference =
        (a * a * a * (attraction(r + v) - attraction(r))).cast<double>();
    const Eigen::Vector3d actual = eigen(gravity_gradient(1.0, m.direction, m.v));
    EXPECT_LT((actual - difference).norm(), 2e-5);
  }
}

TEST(InertiaGradient, IsItsDefinitionByCrossProducts) {
  std::mt19937_64 bits(10);
  for (int i = 0; i < 1000; ++i) {
    const Motion m = random_motion(bits);
    const Eigen::Vector3d omega = eigen(m.rate);
    const Eigen::Vector3d expected =
        omega.cross(omega.cross(eigen(m.v))) + eigen(m.acceleration).cross(eigen(m.v));
    const Eigen::Vector3d actual = eigen(inertia_gradient(m.rate, m.acceleration, m.v));
    EXPECT_LT((actual - expected).norm(), tolerance);
    EXPECT_LT((actual - inertia_matrix(m) * eigen(m.v)).norm(), tolerance);
  }
}

// A point at rest on a frame that spins about Y falls outwards: Ω∧(Ω∧v) = −Ω² v for v across the
// axis.
TEST(InertiaGradient, IsCentripetalAcrossTheAxis) {
  const Vector3<double> result = inertia_gradient(Vector3<double>{0.0, 2.0, 0.0}, Vector3<double>{},
                                                  Vector3<double>{3.0, 5.0, 7.0});
  EXPECT_EQ(result.x, -12.0);
  EXPECT_EQ(result.y, 0.0);
  EXPECT_EQ(result.z, -28.0);
}

TEST(GradientMatrix, IsGravityMinusInertia) {
  std::mt19937_64 bits(11);
  for (int i = 0; i < 1000; ++i) {
    const Motion m = random_motion(bits);
    const Eigen::Matrix3d actual =
        eigen(gradient_matrix(gradient_s2, m.direction, m.rate, m.acceleration));
    EXPECT_LT((actual - (gravity_matrix(m) - inertia_matrix(m))).norm(), tolerance);
  }
}

// Trace [T] = 0 outside the Earth, trace [In] = −2Ω².
TEST(GradientMatrix, HasTheTraceOfTheRotationAlone) {
  std::mt19937_64 bits(12);
  for (int i = 0; i < 1000; ++i) {
    const Motion m = random_motion(bits);
    const Eigen::Matrix3d still = eigen(gradient_matrix(gradient_s2, m.direction, {}, {}));
    EXPECT_NEAR(still.trace(), 0.0, tolerance);
    EXPECT_LT((still - still.transpose()).norm(), tolerance);
    const Eigen::Matrix3d turning =
        eigen(gradient_matrix(gradient_s2, m.direction, m.rate, m.acceleration));
    EXPECT_NEAR(turning.trace(), 2.0 * dot(m.rate, m.rate), tolerance);
  }
}

}  // namespace
}  // namespace proofmass
