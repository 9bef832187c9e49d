#include "core/campaign/dispersion.hpp"
#include "core/runs.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

Dispersion normal_law(Law law, double mean, double deviation, double minimum = 0.0,
                      double maximum = 0.0) {
  Dispersion normal;
  normal.law = law;
  normal.mean = mean;
  normal.standard_deviation = deviation;
  normal.minimum = minimum;
  normal.maximum = maximum;
  return normal;
}

/// Moments of n draws against those of the law, each within five standard errors: σ/√n of the mean,
/// √((μ₄ − σ⁴)/n) of the variance, with the sample's fourth moment for μ₄.
void expect_moments_of_draws(const Dispersion& law) {
  law.validate("law");
  constexpr std::uint64_t num_draws = 100'000, seed = 5;
  const LawMoments moments = moments_of(law).value();
  double sum = 0.0, square = 0.0, fourth = 0.0;
  for (std::uint64_t run = 0; run < num_draws; ++run) {
    const double d = draw_value(law, "quantity", seed, RunIndex{run}, 0, 0.0) - moments.mean;
    sum += d / num_draws;
    square += d * d / num_draws;
    fourth += d * d * d * d / num_draws;
  }
  const double variance = moments.standard_deviation * moments.standard_deviation;
  EXPECT_NEAR(sum, 0.0, 5.0 * moments.standard_deviation / std::sqrt(num_draws));
  EXPECT_NEAR(square, variance, 5.0 * std::sqrt((fourth - variance * variance) / num_draws));
}

TEST(MomentsOfALaw, AreThoseOfItsDraws) {
  Dispersion uniform;
  uniform.minimum = -1.0;
  uniform.maximum = 5.0;
  expect_moments_of_draws(uniform);
  expect_moments_of_draws(normal_law(Law::normal, 3.0, 2.0));
  expect_moments_of_draws(normal_law(Law::truncated_normal, 0.5, 1.0, 0.0, 4.0));
  expect_moments_of_draws(normal_law(Law::truncated, 1.0, 2.0, 0.5, 3.0));
  expect_moments_of_draws(normal_law(Law::truncated, 0.0, 1.0, -8.0, 8.0));
  expect_moments_of_draws(normal_law(Law::truncated, 0.0, 1.0, 5.0, 9.0));
  expect_moments_of_draws(normal_law(Law::truncated, 0.0, 1.0, -30.5, -30.0));
}

// One run in a thousand has nearly all of the variance: 300²·1e-3 of 90.9.
TEST(MomentsOfALaw, CountARareValue) {
  Dispersion law;
  law.law = Law::discrete;
  law.values = {-1.0, 300.0, 1.0};
  law.probabilities = {0.4995, 1e-3, 0.4995};
  expect_moments_of_draws(law);
  const LawMoments moments = moments_of(law).value();
  EXPECT_NEAR(moments.mean, 0.3, 1e-12);
  EXPECT_NEAR(moments.standard_deviation, std::sqrt(0.999 + 90.0 - 0.09), 1e-12);
}

TEST(MomentsOfALaw, AreWhatTheLawSays) {
  Dispersion fixed;
  fixed.law = Law::fixed;
  fixed.value = -7.0;
  EXPECT_EQ(moments_of(fixed)->mean, -7.0);
  EXPECT_EQ(moments_of(fixed)->standard_deviation, 0.0);
  const Dispersion correlated = normal_law(Law::correlated, 1.0, 2.0);
  EXPECT_EQ(moments_of(correlated)->mean, 1.0);
  EXPECT_EQ(moments_of(correlated)->standard_deviation, 2.0);
  for (const Law law : {Law::table, Law::derived}) {
    fixed.law = law;
    EXPECT_FALSE(moments_of(fixed).has_value());
  }
}

/// Of the standard normal law beyond a, in closed form with the digits of a long double:
/// λ = φ(a)/(1 − Φ(a)) and √(1 + aλ − λ²).
LawMoments moments_beyond(long double a) {
  const long double density =
      std::exp(-0.5L * a * a) / std::sqrt(2.0L * std::numbers::pi_v<long double>);
  const long double lambda = density / (0.5L * std::erfc(a / std::numbers::sqrt2_v<long double>));
  return {static_cast<double>(lambda),
          static_cast<double>(std::sqrt(1.0L + a * lambda - lambda * lambda))};
}

TEST(MomentsOfATruncatedLaw, KeepTheirDigitsInATail) {
  for (const double a : {-3.0, 0.0, 1.0, 5.0, 12.0, 30.0}) {
    const LawMoments expected = moments_beyond(a);
    for (const double sign : {1.0, -1.0}) {
      const double far = a + 25.0, middle = 2.0, deviation = 0.25;
      const double from = middle + deviation * sign * (sign > 0.0 ? a : far);
      const double to = middle + deviation * sign * (sign > 0.0 ? far : a);
      const LawMoments found =
          moments_of(normal_law(Law::truncated, middle, deviation, from, to)).value();
      const double tolerance = 1e-6 * expected.standard_deviation;
      EXPECT_NEAR((found.mean - middle) / deviation * sign, expected.mean, tolerance) << a;
      EXPECT_NEAR(found.standard_deviation / deviation, expected.standard_deviation, tolerance)
          << a;
    }
  }
}

// On an interval of width w ≪ 1 the density is e^(−p w x): the mean leaves the middle by −p w²/12,
// and the deviation is w/√12 to the order (p w)²/60.
TEST(MomentsOfATruncatedLaw, AreNearlyThoseOfAUniformLawInASliver) {
  for (const double p : {0.0, 3.0, -20.0}) {
    const double width = 1e-5;
    const LawMoments found = moments_of(normal_law(Law::truncated, 0.0, 1.0, p, p + width)).value();
    EXPECT_NEAR(found.mean - p, 0.5 * width - p * width * width / 12.0, 1e-6 * width);
    EXPECT_NEAR(found.standard_deviation, width / std::sqrt(12.0), 1e-6 * width);
  }
}

}  // namespace
}  // namespace proofmass
