#include <Eigen/Dense>

#include "core/microscope/orbit/gradient.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"
#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

const std::vector<double>& eccentricities() {
  static const std::vector<double> values{0.0, 1e-6, 5e-3, 0.05, 0.3, 0.7};
  return values;
}

/// Anomalies recovered from the direction, by the textbook's formulas in long double.
struct Anomalies {
  long double eccentric, radius_ratio;
};

Anomalies anomalies(const OrbitPoint& point, double eccentricity) {
  const long double e = eccentricity;
  const long double x = point.radial_I_x;
  const long double z = point.radial_I_z;
  const long double eccentric = std::atan2(std::sqrt(1.0L - e * e) * z, e + x);
  return {eccentric, (1.0L - e * e) / (1.0L + e * x)};
}

// E − e sin E = M: the direction rounds to 1e-16, which 1/(1 − e) may amplify.
TEST(KeplerOrbit, SolvesKeplersEquation) {
  for (const double e : eccentricities()) {
    const KeplerOrbit orbit({.period_s = 5950.0, .eccentricity = e});
    for (int k = -3000; k < 6000; ++k) {
      const OrbitPoint point = orbit.at(0.99991 * k);
      const auto [eccentric, radius_ratio] = anomalies(point, e);
      const long double mean = 2.0L * std::numbers::pi_v<long double> * (0.99991 * k) / 5950.0L;
      const long double residual = eccentric - e * std::sin(eccentric) - mean;
      const long double wrapped = std::remainder(residual, 2.0L * std::numbers::pi_v<long double>);
      ASSERT_NEAR(static_cast<double>(wrapped), 0.0, 3e-15 / (1.0 - e)) << e << ", " << k;
      const double n2 = orbit.mean_motion_rad_s() * orbit.mean_motion_rad_s();
      const auto expected = static_cast<double>(n2 / (radius_ratio * radius_ratio * radius_ratio));
      ASSERT_NEAR(point.gradient_s2 / expected, 1.0, 5e-15 / (1.0 - e)) << e << ", " << k;
    }
  }
}

// A lane that needs a second step of Newton's method would have to be frozen while others take it.
TEST(KeplerOrbit, TakesBatchesOfTimesUpToAnEccentricityOf0p008) {
  for (const double e : {0.0, 5e-3, 8e-3}) {
    const KeplerOrbit orbit({.period_s = 5950.0, .eccentricity = e});
    for (int k = 0; k < 23800; ++k) {
      const OrbitPoint alone = orbit.at(0.25 * k);
      const std::optional<OrbitPoint> lane = orbit.at_lanes(0.25 * k);
      ASSERT_TRUE(lane.has_value()) << e << ", " << k;
      ASSERT_EQ(std::bit_cast<std::uint64_t>(lane->radial_I_x),
                std::bit_cast<std::uint64_t>(alone.radial_I_x));
      ASSERT_EQ(std::bit_cast<std::uint64_t>(lane->gradient_s2),
                std::bit_cast<std::uint64_t>(alone.gradient_s2));
    }
  }
  const KeplerOrbit eccentric({.period_s = 5950.0, .eccentricity = 0.1});
  EXPECT_FALSE(eccentric.at_lanes(500.0).has_value());
}

TEST(KeplerOrbit, GivesSineAndCosineOfTheMeanAnomaly) {
  const KeplerOrbit orbit({.period_s = 5950.0, .eccentricity = 0.3});
  for (int k = -50; k < 50; ++k) {
    const double t = 131.7 * k;
    EXPECT_NEAR(orbit.at(t).mean_anomaly.sine, std::sin(two_pi * t / 5950.0), 1e-14);
    EXPECT_NEAR(orbit.at(t).mean_anomaly.cosine, std::cos(two_pi * t / 5950.0), 1e-14);
  }
}

/// Components of the gradient in I, s⁻².
struct Gradient {
  double xx, xz, yy, zz;
};

Gradient gradient_at(const KeplerOrbit& orbit, double t) {
  const OrbitPoint p = orbit.at(t);
  const double g = p.gradient_s2;
  return {g * (3.0 * p.radial_I_x * p.radial_I_x - 1.0), g * 3.0 * p.radial_I_x * p.radial_I_z, -g,
          g * (3.0 * p.radial_I_z * p.radial_I_z - 1.0)};
}

/// Amplitude of a component at a multiple of f_orb, over n². The trapezoidal rule on a periodic
/// function is exact up to the harmonics beyond 1024.
double amplitude(const KeplerOrbit& orbit, double Gradient::*component, int multiple) {
  constexpr int num_points = 1024;
  std::complex<double> sum = 0.0;
  for (int k = 0; k < num_points; ++k) {
    const double turns = static_cast<double>(k) / num_points;
    sum += gradient_at(orbit, turns * orbit.period_s()).*component *
           std::polar(1.0, -two_pi * multiple * turns);
  }
  const double n = orbit.mean_motion_rad_s();
  return 2.0 * std::abs(sum) / num_points / (n * n);
}

// With (a/r)³ = 1 + 3e²/2 + (3e + 27e³/8) cos M + …, and (a/r)³ cos 2ν and (a/r)³ sin 2ν whose
// Hansen coefficients are −e/2 + e³/16, 1 − 5e²/2 and e³/48 at 1, 2 and −1 [Kaula1966] table 2: to
// the first order 3e/4, 3e/4, 3e and 9e/4 at f_orb, of which 29/12, −1/12, 9/8 and 25/36 of e² are
// the next, and 3/2 (1 − e²) and 3/2 (1 − 5e²/2) at 2 f_orb. What is left out is of the order e⁴.
TEST(KeplerOrbit, HasTheGradientAmplitudesOfSecondOrder) {
  const double e = 0.02;
  const KeplerOrbit orbit({.period_s = 5950.0, .eccentricity = e});
  const double e2 = e * e;
  const double tolerance = 10.0 * e2 * e2;
  EXPECT_NEAR(amplitude(orbit, &Gradient::xx, 1) / (0.75 * e), 1.0 + 29.0 / 12.0 * e2, tolerance);
  EXPECT_NEAR(amplitude(orbit, &Gradient::xz, 1) / (0.75 * e), 1.0 - 1.0 / 12.0 * e2, tolerance);
  EXPECT_NEAR(amplitude(orbit, &Gradient::yy, 1) / (3.0 * e), 1.0 + 9.0 / 8.0 * e2, tolerance);
  EXPECT_NEAR(amplitude(orbit, &Gradient::zz, 1) / (2.25 * e), 1.0 + 25.0 / 36.0 * e2, tolerance);
  EXPECT_NEAR(amplitude(orbit, &Gradient::xx, 2) / 1.5, 1.0 - e2, tolerance);
  EXPECT_NEAR(amplitude(orbit, &Gradient::xz, 2) / 1.5, 1.0 - 2.5 * e2, tolerance);
}

// [Hardy2013] tab:Budget's gradients at f_orb: 4.18e-9, 1.67e-8, 1.25e-8 s⁻², and 1.67e-6 at 2
// f_orb.
TEST(KeplerOrbit, HasTheGradientsOfTheMission) {
  const KeplerOrbit orbit(OrbitConfig{});
  const double n2 = orbit.mean_motion_rad_s() * orbit.mean_motion_rad_s();
  EXPECT_NEAR(n2 * amplitude(orbit, &Gradient::xx, 1), 4.18e-9, 0.005e-9);
  EXPECT_NEAR(n2 * amplitude(orbit, &Gradient::xz, 1), 4.18e-9, 0.005e-9);
  EXPECT_NEAR(n2 * amplitude(orbit, &Gradient::yy, 1), 1.67e-8, 0.005e-8);
  EXPECT_NEAR(n2 * amplitude(orbit, &Gradient::zz, 1), 1.25e-8, 0.005e-8);
  EXPECT_NEAR(n2 * amplitude(orbit, &Gradient::xx, 2), 1.67e-6, 0.005e-6);
}

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

TEST(GradientMatrix, IsGravityMinusInertia) {
  std::mt19937_64 bits(11);
  for (int i = 0; i < 1000; ++i) {
    const Motion m = random_motion(bits);
    const Eigen::Matrix3d actual =
        eigen(gradient_matrix(gradient_s2, m.direction, m.rate, m.acceleration));
    EXPECT_LT((actual - (gravity_matrix(m) - inertia_matrix(m))).norm(), tolerance);
  }
}

}  // namespace
}  // namespace proofmass
