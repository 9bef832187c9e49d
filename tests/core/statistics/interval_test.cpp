#include "core/statistics/interval.hpp"

#include "core/error.hpp"
#include "core/statistics/comparison.hpp"
#include "core/statistics/order.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

std::vector<double> one_to(int n) {
  std::vector<double> values;
  for (int i = 1; i <= n; ++i) values.push_back(i);
  return values;
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

// An upper bound exists if 0.99ⁿ ≤ 0.025, n ≥ 367.04.
TEST(PercentileInterval, IsEmptyWithTooFewValues) {
  EXPECT_FALSE(percentile_interval(one_to(367), 0.99, 0.95).has_value());
  EXPECT_TRUE(percentile_interval(one_to(368), 0.99, 0.95).has_value());
  EXPECT_FALSE(percentile_interval(one_to(367), 0.01, 0.95).has_value());
  EXPECT_FALSE(percentile_interval({}, 0.5, 0.95).has_value());
}

TEST(BootstrapDeviationInterval, OfEqualValuesIsAPoint) {
  const auto interval = bootstrap_deviation_interval(std::vector<double>(50, 3.0), 0.95);
  EXPECT_EQ(interval->lower, 0.0);
  EXPECT_EQ(interval->upper, 0.0);
}

// Of the resamples of these four an eighth has no deviation, a half deviates by 1, and three
// eighths as the values do, by the most there is: counted by halves, 13/16 lie below. The bias z₀
// is then Φ⁻¹(13/16) = 0.887, the acceleration 0, and the lower bound the percentile Φ(2z₀ − 1.96)
// = 0.43.
TEST(BootstrapDeviationInterval, CountsResamplesThatEqualTheEstimateByHalves) {
  const auto interval =
      bootstrap_deviation_interval(std::vector<double>{-1.0, -1.0, 1.0, 1.0}, 0.95);
  EXPECT_DOUBLE_EQ(interval->lower, 1.0);
  EXPECT_DOUBLE_EQ(interval->upper, std::sqrt(4.0 / 3.0));
}

// An eighth of the resamples of 57 equal values and two others have the equal ones alone, and
// deviate by nothing but rounding.
TEST(BootstrapDeviationInterval, IsNotKnownWhereResamplesOfEqualValuesReachItsEnd) {
  std::vector<double> values(59, 0.5);
  values[7] = values[31] = 1.5;
  EXPECT_FALSE(bootstrap_deviation_interval(values, 0.95).has_value());
  // A ninth of the resamples of three values have one alone, and of ten next to none.
  EXPECT_FALSE(bootstrap_deviation_interval(one_to(2), 0.95).has_value());
  EXPECT_FALSE(bootstrap_deviation_interval(one_to(3), 0.95).has_value());
  EXPECT_TRUE(bootstrap_deviation_interval(one_to(10), 0.95).has_value());
}

// A campaign database may hold errors whose cubes no double can hold.
TEST(BootstrapDeviationInterval, DoesNotDependOnTheUnit) {
  std::vector<double> values;
  for (int i = 0; i < 20; ++i) values.push_back((i * 7) % 11);
  const Interval expected = bootstrap_deviation_interval(values, 0.95).value();
  for (const double unit : {0x1p300, 0x1p-300, 0x1p-480}) {
    std::vector<double> others = values;
    for (double& value : others) value *= unit;
    const Interval interval = bootstrap_deviation_interval(others, 0.95).value();
    EXPECT_EQ(interval.lower / unit, expected.lower) << unit;
    EXPECT_EQ(interval.upper / unit, expected.upper) << unit;
  }
}

using Values = std::vector<double>;

// Differences 1, 2, 3, 4, 5, −6: ranks are the magnitudes, the negative sum is 6. Of the 64 choices
// of signs 14 have a sum of at most 6: 1 + 1 + 1 + 2 + 2 + 3 + 4.
TEST(ComparePaired, CountsSignsAndRanks) {
  const Values first{0, 0, 0, 0, 0, 6};
  const Values second{1, 2, 3, 4, 5, 0};
  EXPECT_NEAR(sign_test_p_value(5, 1), 2.0 * 7.0 / 64.0, 1e-14);
  EXPECT_NEAR(rank_test_p_value(test::differences_of(first, second)), 2.0 * 14.0 / 64.0, 1e-14);
}

// Differences 1, 1, 1, −1 and 0: ranks 2.5 each, sum 2.5 against 5 with variance 4 · 2.5²/4.
TEST(ComparePaired, SharesRanksAndLeavesOutPairsWithoutDifference) {
  EXPECT_NEAR(rank_test_p_value({1, 1, 1, -1, 0}), std::erfc(1.0 / std::sqrt(2.0)), 1e-14);
  EXPECT_NEAR(sign_test_p_value(3, 1), 2.0 * 5.0 / 16.0, 1e-14);
}

TEST(ComparePaired, OfEqualCampaignsFindsNothing) {
  EXPECT_EQ(sign_test_p_value(0, 0), 1.0);
  EXPECT_EQ(rank_test_p_value(Values(100, 0.0)), 1.0);
}

// A campaign database may hold numbers up to 1e90, whose variance has a square beyond all doubles.
TEST(CompareUnpaired, DoesNotDependOnTheUnit) {
  const double expected = compare_unpaired(Values{1, 2, 3}, Values{4, 5, 6}, 0.95).mean_p_value;
  for (const double unit : {0x1p300, 0x1p-300}) {
    const Values first{unit, 2 * unit, 3 * unit};
    const Values second{4 * unit, 5 * unit, 6 * unit};
    EXPECT_NEAR(compare_unpaired(first, second, 0.95).mean_p_value, expected, 1e-14) << unit;
  }
}

// 4 million steps are counted, one more by the limiting law: the two agree to 1/√n.
TEST(CompareUnpaired, JoinsTheExactLawToTheLimit) {
  const Values first = test::normal_column(2000, {.seed = 53});
  Values second = test::normal_column(2001, {.seed = 53, .column = 1});
  for (double& value : second) value += 0.05;
  const double limit = compare_unpaired(first, second, 0.95).law_p_value;
  second.pop_back();
  const double exact = compare_unpaired(first, second, 0.95).law_p_value;
  EXPECT_NEAR(limit / exact, 1.0, 0.05);
}

TEST(CompareUnpaired, OfConstantsComparesTheConstants) {
  const UnpairedComparison same = compare_unpaired(Values{2, 2}, Values{2, 2, 2}, 0.95);
  EXPECT_EQ(same.mean_p_value, 1.0);
  EXPECT_EQ(same.law_p_value, 1.0);
  EXPECT_FALSE(same.interval.has_value());
  const UnpairedComparison other = compare_unpaired(Values{2, 2}, Values{3, 3}, 0.95);
  EXPECT_EQ(other.mean_p_value, 0.0);
  EXPECT_NEAR(other.p_value, 2.0 / 6.0, 1e-15);  // Of the 6 ways to mix them two keep them apart.
}

// Products of two normal values: |x y| is as skew as the error of K2c. In 2,000 comparisons of 10
// with 250 values of this one law Welch's t is below 0.5 % in 104 instead of 10, standard error 3.
TEST(Comparisons, OfFewValuesErrNoMoreOftenThanTheySay) {
  const auto products = [](std::size_t count, std::uint64_t repetition, std::uint32_t column) {
    Values values =
        test::normal_column(count, {.seed = 55, .repetition = repetition, .column = column});
    const Values factors =
        test::normal_column(count, {.seed = 55, .repetition = repetition, .column = column + 1});
    for (std::size_t i = 0; i < count; ++i) values[i] = std::abs(values[i] * factors[i]);
    return values;
  };
  int num_found = 0;
  for (std::uint64_t repetition = 0; repetition < 2000; ++repetition) {
    const UnpairedComparison comparison =
        compare_unpaired(products(10, repetition, 0), products(250, repetition, 2), 0.95);
    num_found += comparison.p_value <= 0.005;
  }
  EXPECT_LE(num_found, 10 + 3 * 3);
}

// From 100 values on the p-value is that of the means alone; with one less it never falls below
// that of the laws.
TEST(CompareUnpaired, AsksBothTestsBelowAHundredValues) {
  const Values second = test::normal_column(300, {.seed = 56});
  Values first = test::normal_column(num_welch_min, {.seed = 56, .column = 1});
  for (double& value : first) value += 0.5;
  const UnpairedComparison many = compare_unpaired(first, second, 0.95);
  EXPECT_EQ(many.p_value, many.mean_p_value);
  EXPECT_LT(many.mean_p_value, many.law_p_value);
  first.pop_back();
  for (const UnpairedComparison& few :
       {compare_unpaired(first, second, 0.95), compare_unpaired(second, first, 0.95)}) {
    EXPECT_EQ(few.p_value, few.law_p_value);
    EXPECT_LT(few.mean_p_value, few.law_p_value);
  }
}

}  // namespace
}  // namespace proofmass
