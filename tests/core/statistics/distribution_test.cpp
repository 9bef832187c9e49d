#include "core/statistics/distribution.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace proofmass {
namespace {

// The 97.5th percentiles of any table of Student's law, and Φ(1.96).
TEST(StudentQuantile, HasThePublishedPoints) {
  EXPECT_NEAR(student_quantile(0.975, 1.0), 12.706, 5e-4);
  EXPECT_NEAR(student_quantile(0.975, 10.0), 2.228, 5e-4);
  EXPECT_NEAR(student_quantile(0.025, 30.0), -2.042, 5e-4);
  EXPECT_NEAR(normal_cumulative(1.96), 0.9750, 5e-5);
}

TEST(StudentTwoSided, InvertsTheQuantile) {
  for (const double degrees : {1.0, 3.5, 19.0, 1e4, 1e8}) {
    const double t = student_quantile(0.99, degrees);
    EXPECT_NEAR(student_two_sided(t, degrees) / 0.02, 1.0, 1e-11) << degrees;
  }
}

// The 95th percentile of χ² with ten degrees of freedom, of any table.
TEST(ChiSquare, HasThePublishedPoints) {
  EXPECT_NEAR(chi_square_above(18.307, 10.0), 0.05, 5e-6);
  EXPECT_NEAR(chi_square_at_most(3.940, 10.0), 0.05, 5e-5);
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

}  // namespace
}  // namespace proofmass
