#include "core/microscope/orbit/kepler_orbit.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>
#include <optional>
#include <vector>

namespace proofmass {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

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
    for (int k = 0; k < 6000; ++k) {
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

TEST(KeplerOrbit, DirectionIsAUnitVector) {
  for (const double e : eccentricities()) {
    const KeplerOrbit orbit({.period_s = 5950.0, .eccentricity = e});
    for (int k = 0; k < 1000; ++k) {
      const OrbitPoint p = orbit.at(5.951 * k);
      ASSERT_NEAR(p.radial_I_x * p.radial_I_x + p.radial_I_z * p.radial_I_z, 1.0,
                  2e-15 / (1.0 - e));
    }
  }
}

TEST(KeplerOrbit, StartsAtPerigeeAndMovesTowardsZ) {
  const KeplerOrbit orbit({.period_s = 5950.0, .eccentricity = 0.1});
  const OrbitPoint start = orbit.at(0.0);
  EXPECT_EQ(start.radial_I_x, 1.0);
  EXPECT_EQ(start.radial_I_z, 0.0);
  const double n = two_pi / 5950.0;
  EXPECT_NEAR(start.gradient_s2 / (n * n / (0.9 * 0.9 * 0.9)), 1.0, 1e-15);
  EXPECT_GT(orbit.at(1.0).radial_I_z, 0.0);
  EXPECT_NEAR(orbit.at(2975.0).radial_I_x, -1.0, 1e-15);  // Apogee.
}

// From t to −t the orbit mirrors; a period on it repeats, within the rounding of t/period.
TEST(KeplerOrbit, IsSymmetricAboutPerigeeAndPeriodic) {
  const KeplerOrbit orbit({.period_s = 5950.0, .eccentricity = 5e-3});
  for (const double t : {0.25, 100.0, 1234.5, 4000.0}) {
    const OrbitPoint after = orbit.at(t);
    const OrbitPoint before = orbit.at(-t);
    EXPECT_NEAR(before.radial_I_x, after.radial_I_x, 1e-15);
    EXPECT_NEAR(before.radial_I_z, -after.radial_I_z, 1e-15);
    EXPECT_NEAR(before.gradient_s2 / after.gradient_s2, 1.0, 1e-15);
    const OrbitPoint later = orbit.at(t + 40 * 5950.0);
    EXPECT_NEAR(later.radial_I_x, after.radial_I_x, 1e-13);
    EXPECT_NEAR(later.radial_I_z, after.radial_I_z, 1e-13);
  }
}

TEST(KeplerOrbit, GivesSineAndCosineOfTheMeanAnomaly) {
  const KeplerOrbit orbit({.period_s = 5950.0, .eccentricity = 0.3});
  for (int k = -50; k < 50; ++k) {
    const double t = 131.7 * k;
    EXPECT_NEAR(orbit.at(t).mean_anomaly.sine, std::sin(two_pi * t / 5950.0), 1e-14);
    EXPECT_NEAR(orbit.at(t).mean_anomaly.cosine, std::cos(two_pi * t / 5950.0), 1e-14);
  }
}

// r² dν/dt = n a² √(1 − e²). The derivative comes from a step h of 10 s: its error is h²/6 times
// the third derivative, which is below 30 n² of the first for e ≤ 0.3: 6e-4. Halving the step and
// extrapolating leaves the fourth order, below 1e-6.
TEST(KeplerOrbit, SweepsEqualAreasInEqualTimes) {
  for (const double e : {5e-3, 0.05, 0.3}) {
    const KeplerOrbit orbit({.period_s = 5950.0, .eccentricity = e});
    const double n = orbit.mean_motion_rad_s();
    const auto rate = [&](double t, double half_step) {
      const OrbitPoint a = orbit.at(t - half_step);
      const OrbitPoint b = orbit.at(t + half_step);
      const double sine = a.radial_I_x * b.radial_I_z - a.radial_I_z * b.radial_I_x;
      return std::asin(sine) / (2.0 * half_step);
    };
    for (int k = 0; k < 200; ++k) {
      const double t = 29.75 * k;
      const double angular_rate = (4.0 * rate(t, 5.0) - rate(t, 10.0)) / 3.0;
      const double radius_ratio = std::cbrt(n * n / orbit.at(t).gradient_s2);
      EXPECT_NEAR(radius_ratio * radius_ratio * angular_rate / n, std::sqrt(1.0 - e * e), 1e-6)
          << t;
    }
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
// Hansen coefficients are −e/2 + e³/16, 1 − 5e²/2 and e³/48 at 1, 2 and −1 [Kaula1966] table 2. The
// order that the leading terms leave is at most 2.42 e².
TEST(KeplerOrbit, HasTheGradientAmplitudesOfFirstOrder) {
  const double e = 5e-3;
  const KeplerOrbit orbit({.period_s = 5950.0, .eccentricity = e});
  const double tolerance = 2.5 * e * e;
  EXPECT_NEAR(amplitude(orbit, &Gradient::xx, 1) / (0.75 * e), 1.0, tolerance);
  EXPECT_NEAR(amplitude(orbit, &Gradient::xz, 1) / (0.75 * e), 1.0, tolerance);
  EXPECT_NEAR(amplitude(orbit, &Gradient::yy, 1) / (3.0 * e), 1.0, tolerance);
  EXPECT_NEAR(amplitude(orbit, &Gradient::zz, 1) / (2.25 * e), 1.0, tolerance);
  EXPECT_NEAR(amplitude(orbit, &Gradient::xx, 2) / 1.5, 1.0, tolerance);
  EXPECT_NEAR(amplitude(orbit, &Gradient::xz, 2) / 1.5, 1.0, 1.01 * tolerance);
}

// The next order of the same series: 29/12, 1/12, 9/8 and 25/36 of e² at f_orb, −1 and −5/2 at 2
// f_orb; what it leaves is of the order e⁴.
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

}  // namespace
}  // namespace proofmass
