#include "core/statistics/distribution.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/random/normal.hpp"
#include "core/statistics/detail/special.hpp"

namespace proofmass {
namespace {

// The C library's erfc is another implementation; its own error is 1e-16.
TEST(NormalCumulative, AgreesWithTheErrorFunction) {
  for (double x = -8.0; x <= 8.0; x += 0.1) {
    const double expected = 0.5 * std::erfc(-x / std::numbers::sqrt2);
    EXPECT_NEAR(normal_cumulative(x) / expected, 1.0, 1e-13) << x;
  }
}

// With one degree of freedom the quantile is tan(π(p − ½)), with two (2p − 1)/√(2p(1 − p)).
TEST(StudentQuantile, HasItsClosedForms) {
  for (const double p : {0.001, 0.025, 0.3, 0.6, 0.95, 0.975, 0.9995}) {
    const double first = std::tan(std::numbers::pi * (p - 0.5));
    EXPECT_NEAR(student_quantile(p, 1.0) / first, 1.0, 1e-12) << p;
    const double second = (2.0 * p - 1.0) / std::sqrt(2.0 * p * (1.0 - p));
    EXPECT_NEAR(student_quantile(p, 2.0) / second, 1.0, 1e-12) << p;
  }
  EXPECT_EQ(student_quantile(0.5, 3.0), 0.0);
}

// Next to the normal law, t = z + (z³ + z)/4ν + O(1/ν²) with a factor of 3 at z = 2 [DLMF 26].
TEST(StudentQuantile, TendsToTheNormalOne) {
  const double z = inverse_normal(0.975);
  const double expected = z + (z * z * z + z) / 4e6;
  EXPECT_NEAR(student_quantile(0.975, 1e6), expected, 1e-11);
}

TEST(StudentTwoSided, InvertsTheQuantile) {
  for (const double degrees : {1.0, 3.5, 19.0, 1e4, 1e8}) {
    const double t = student_quantile(0.99, degrees);
    EXPECT_NEAR(student_two_sided(t, degrees) / 0.02, 1.0, 1e-11) << degrees;
  }
}

// I_x(a, 1) = xᵃ and I_x(1, b) = 1 − (1 − x)ᵇ.
TEST(BetaQuantile, HasItsClosedForms) {
  for (const double p : {0.01, 0.3, 0.5, 0.9}) {
    EXPECT_NEAR(beta_quantile(p, 4.0, 1.0), std::pow(p, 0.25), 1e-14);
    EXPECT_NEAR(beta_quantile(p, 1.0, 7.0), 1.0 - std::pow(1.0 - p, 1.0 / 7.0), 1e-14);
  }
}

// F of (1, ν) degrees of freedom is the square of Student's t.
TEST(FisherQuantile, OfOneDegreeIsASquaredStudent) {
  const double t = student_quantile(0.975, 12.0);
  EXPECT_NEAR(fisher_quantile(0.95, 1.0, 12.0) / (t * t), 1.0, 1e-12);
}

TEST(Binomial, TailsAreTheSumsOfItsTerms) {
  constexpr int n = 12;
  constexpr double p = 0.3;
  double at_most = 0.0;
  double term = std::pow(1.0 - p, n);
  for (int k = 0; k <= n; ++k) {
    EXPECT_NEAR(binomial_at_least(k, n, p), 1.0 - at_most, 1e-14) << k;
    at_most += term;
    EXPECT_NEAR(binomial_at_most(k, n, p), at_most, 1e-14) << k;
    term *= p / (1.0 - p) * (n - k) / (k + 1.0);
  }
  EXPECT_EQ(binomial_at_most(-1.0, n, p), 0.0);
  EXPECT_EQ(binomial_at_least(13.0, n, p), 0.0);
}

// Both series hold for every x; they meet at 1. Quantiles of any table.
TEST(KolmogorovUpper, HasThePublishedPoints) {
  EXPECT_NEAR(kolmogorov_upper(1.36), 0.0495, 5e-5);
  EXPECT_NEAR(kolmogorov_upper(1.63), 0.0098, 5e-5);
  EXPECT_NEAR(kolmogorov_upper(0.82757), 0.5, 2e-5);  // The median.
  EXPECT_NEAR(kolmogorov_upper(std::nextafter(1.0, 0.0)), kolmogorov_upper(1.0), 1e-15);
  EXPECT_EQ(kolmogorov_upper(0.0), 1.0);
  EXPECT_GE(kolmogorov_upper(40.0), 0.0);
}

// I_x(a, b) + I_y(b, a) = 1 joins the two branches of the fraction; sizes up to those of a billion
// runs, where the logarithms of Γ would cancel 10 digits.
TEST(RegularisedBeta, IsSymmetric) {
  for (const double a : {0.5, 3.0, 700.0, 4e8}) {
    for (const double b : {0.5, 20.0, 1e9}) {
      const double x = a / (a + b);
      const detail::Tails one = detail::regularised_beta(a, b, x, 1.0 - x);
      const detail::Tails other = detail::regularised_beta(b, a, 1.0 - x, x);
      EXPECT_NEAR(one.lower, other.upper, 1e-10) << a << " " << b;
      EXPECT_GT(one.lower, 0.0);
    }
  }
}

}  // namespace
}  // namespace proofmass
