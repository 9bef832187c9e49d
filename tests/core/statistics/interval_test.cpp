#include "core/statistics/interval.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/error.hpp"
#include "core/statistics/order.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/message_of.hpp"

namespace proofmass {
namespace {

std::vector<double> one_to(int n) {
  std::vector<double> values;
  for (int i = 1; i <= n; ++i) values.push_back(i);
  return values;
}

// t of 4 degrees of freedom at 97.5 % is 2.776445 in any table.
TEST(MeanInterval, IsStudents) {
  const auto interval = mean_interval(moments(one_to(5)), 0.95);
  const double half_width = 2.776445105 * std::sqrt(2.5 / 5.0);
  EXPECT_NEAR(interval->lower, 3.0 - half_width, 1e-8);
  EXPECT_NEAR(interval->upper, 3.0 + half_width, 1e-8);
  EXPECT_EQ(interval->confidence, 0.95);
}

// 1 to 5: s² = 2.5 and G2 = −1.2, so γ₄ = 1.8; with z = 1.959964 c = 1.644717 and ln σ² is within
// z c √((1.8 − 0.4)/4) = 1.907100 of ln 4.111793.
TEST(DeviationInterval, GoesByTheKurtosis) {
  const auto interval = deviation_interval(moments(one_to(5)), 0.95);
  EXPECT_NEAR(interval->lower, std::sqrt(4.1117934 * std::exp(-1.9070997)), 1e-6);
  EXPECT_NEAR(interval->upper, std::sqrt(4.1117934 * std::exp(1.9070997)), 1e-6);
}

// Of a few values G2 can be below −2, which no law has.
TEST(DeviationInterval, HoldsForTwoValuesInTurn) {
  const std::vector<double> values{-1.0, 1.0, -1.0, 1.0, -1.0, 1.0};
  const Moments about = moments(values);
  EXPECT_LT(about.excess_kurtosis, -2.0);
  const auto interval = deviation_interval(about, 0.95);
  EXPECT_LT(interval->lower, about.standard_deviation);
  EXPECT_GT(interval->upper, about.standard_deviation);
}

TEST(Intervals, OfTooFewValuesAreEmpty) {
  EXPECT_FALSE(mean_interval(moments(one_to(1)), 0.95).has_value());
  EXPECT_FALSE(deviation_interval(moments(one_to(4)), 0.95).has_value());
  EXPECT_FALSE(deviation_interval(moments(one_to(5)), 1.0 - 1e-9).has_value());  // z = 6.
}

TEST(Intervals, RefuseAConfidenceOutsideItsRange) {
  const Moments about = moments(one_to(5));
  const std::string expected = "confidence = 95 (must be in (0, 1))";
  EXPECT_EQ(test::message_of<InvalidArgument>([&] { (void)mean_interval(about, 95.0); }), expected);
  EXPECT_EQ(test::message_of<InvalidArgument>([&] { (void)deviation_interval(about, 95.0); }),
            expected);
  EXPECT_EQ(
      test::message_of<InvalidArgument>([] { (void)percentile_interval(one_to(5), 0.5, 95.0); }),
      expected);
  EXPECT_EQ(test::message_of<InvalidArgument>([] { (void)probability_interval(1, 2, 95.0); }),
            expected);
  EXPECT_EQ(
      test::message_of<InvalidArgument>([] { (void)percentile_interval(one_to(5), 1.0, 0.95); }),
      "level = 1 (must be in (0, 1))");
}

// [HettmanspergerSheather1986]: for the median of 10 values the interval x₍₂₎ to x₍₉₎ covers with
// 0.97852, x₍₃₎ to x₍₈₎ with 0.89062. For 95 %, I = (0.97852 − 0.95)/(0.97852 − 0.89062) = 0.3244
// and the weight of the inner one is 8 I/(2 + 6 I) = 0.6577.
TEST(PercentileInterval, OfTheMedianIsThatOfHettmanspergerAndSheather) {
  const auto interval = percentile_interval(one_to(10), 0.5, 0.95);
  const double share = (1002.0 / 1024 - 0.95) / (1002.0 / 1024 - 912.0 / 1024);
  const double weight = 8.0 * share / (2.0 + 6.0 * share);
  EXPECT_NEAR(interval->lower, 2.0 + weight, 1e-12);
  EXPECT_NEAR(interval->upper, 9.0 - weight, 1e-12);
}

TEST(PercentileInterval, IsTurnedRoundWithTheValues) {
  const std::vector<double> values = sorted(test::normal_column(300, {.seed = 3}));
  std::vector<double> negative;
  for (const double value : values) negative.push_back(-value);
  const auto upper = percentile_interval(values, 0.9, 0.95);
  const auto lower = percentile_interval(sorted(negative), 0.1, 0.95);
  EXPECT_NEAR(upper->lower, -lower->upper, 1e-12);
  EXPECT_NEAR(upper->upper, -lower->lower, 1e-12);
}

// An upper bound exists if 0.99ⁿ ≤ 0.025, n ≥ 367.04.
TEST(PercentileInterval, IsEmptyWithTooFewValues) {
  EXPECT_FALSE(percentile_interval(one_to(367), 0.99, 0.95).has_value());
  EXPECT_TRUE(percentile_interval(one_to(368), 0.99, 0.95).has_value());
  EXPECT_FALSE(percentile_interval(one_to(367), 0.01, 0.95).has_value());
  EXPECT_FALSE(percentile_interval({}, 0.5, 0.95).has_value());
}

// P(X ≤ 2) with the upper bound and P(X ≥ 2) with the lower one are 2.5 % of Bin(10, ·).
TEST(ProbabilityInterval, IsExact) {
  const Interval interval = probability_interval(2, 10, 0.95);
  EXPECT_NEAR(interval.lower, 0.0252107, 1e-7);
  EXPECT_NEAR(interval.upper, 0.5560955, 1e-7);
}

// 1 − 0.025^(1/n) for n runs without a hit.
TEST(ProbabilityInterval, ReachesTheEnds) {
  const double bound = 1.0 - std::pow(0.025, 1.0 / 50.0);
  EXPECT_EQ(probability_interval(0, 50, 0.95).lower, 0.0);
  EXPECT_NEAR(probability_interval(0, 50, 0.95).upper, bound, 1e-14);
  EXPECT_NEAR(probability_interval(50, 50, 0.95).lower, 1.0 - bound, 1e-14);
  EXPECT_EQ(probability_interval(50, 50, 0.95).upper, 1.0);
}

}  // namespace
}  // namespace proofmass
