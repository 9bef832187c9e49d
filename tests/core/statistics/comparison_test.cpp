#include "core/statistics/comparison.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "core/error.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/message_of.hpp"

namespace proofmass {
namespace {

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

// A shift of a tenth of the deviation: invisible between campaigns, plain pair by pair.
TEST(ComparePaired, SeesWhatAnUnpairedComparisonCannot) {
  const Values first = test::normal_column(400, {.seed = 52});
  Values second = test::normal_column(400, {.seed = 52, .column = 1});
  for (std::size_t i = 0; i < second.size(); ++i) second[i] = first[i] + 0.1 + 0.05 * second[i];
  EXPECT_LT(rank_test_p_value(test::differences_of(first, second)), 1e-10);
  EXPECT_GT(compare_unpaired(first, second, 0.95).mean_p_value, 0.05);
}

// Means 2 and 5, squared errors of both 1/3: t = 3/√(2/3), 4 degrees of freedom.
TEST(CompareUnpaired, IsWelchs) {
  const UnpairedComparison comparison = compare_unpaired(Values{1, 2, 3}, Values{4, 5, 6}, 0.95);
  EXPECT_EQ(comparison.mean_difference, 3.0);
  const double error = std::sqrt(2.0 / 3.0);
  EXPECT_NEAR(comparison.interval->lower, 3.0 - 2.776445105 * error, 1e-8);
  // P(|T₄| ≥ t) = 1 − s(1 + c²/2), s = t/√(4 + t²), c² = 4/(4 + t²).
  const double t = 3.0 / error;
  const double s = t / std::sqrt(4.0 + t * t);
  EXPECT_NEAR(comparison.mean_p_value, 1.0 - s * (1.0 + 2.0 / (4.0 + t * t)), 1e-14);
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

// Of the 20 ways to mix three and three, two keep them apart.
TEST(CompareUnpaired, CountsThePathsOfSmirnov) {
  const UnpairedComparison apart = compare_unpaired(Values{1, 2, 3}, Values{4, 5, 6}, 0.95);
  EXPECT_EQ(apart.distance, 1.0);
  EXPECT_NEAR(apart.law_p_value, 2.0 / 20.0, 1e-15);
  const UnpairedComparison mixed = compare_unpaired(Values{1, 3}, Values{2, 3}, 0.95);
  EXPECT_EQ(mixed.distance, 0.5);
  EXPECT_NEAR(mixed.law_p_value, 1.0, 1e-15);
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

// Without any difference a p-value is below 5 % in 5 % of 1000 cases, standard error 0.7 %.
TEST(Comparisons, ErrAsOftenAsTheySay) {
  int num_sign = 0, num_rank = 0, num_mean = 0, num_law = 0;
  for (std::uint64_t repetition = 0; repetition < 1000; ++repetition) {
    const auto a = test::normal_column(120, {.seed = 54, .repetition = repetition, .column = 0});
    const auto b = test::normal_column(120, {.seed = 54, .repetition = repetition, .column = 1});
    const UnpairedComparison unpaired = compare_unpaired(a, b, 0.95);
    std::size_t num_larger = 0;
    for (std::size_t i = 0; i < a.size(); ++i) num_larger += b[i] > a[i];
    num_sign += sign_test_p_value(num_larger, a.size() - num_larger) <= 0.05;
    num_rank += rank_test_p_value(test::differences_of(a, b)) <= 0.05;
    num_mean += unpaired.mean_p_value <= 0.05;
    num_law += unpaired.law_p_value <= 0.05;
  }
  EXPECT_NEAR(num_rank, 50, 28);
  EXPECT_NEAR(num_mean, 50, 28);
  EXPECT_LE(num_sign, 78);  // Laws of counts keep below the level.
  EXPECT_LE(num_law, 78);
  EXPECT_GE(num_sign, 15);
  EXPECT_GE(num_law, 15);
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
  int num_mean = 0, num_found = 0;
  for (std::uint64_t repetition = 0; repetition < 2000; ++repetition) {
    const UnpairedComparison comparison =
        compare_unpaired(products(10, repetition, 0), products(250, repetition, 2), 0.95);
    num_mean += comparison.mean_p_value <= 0.005;
    num_found += comparison.p_value <= 0.005;
  }
  EXPECT_GT(num_mean, 50);
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

TEST(Comparisons, RefuseWhatTheyCannotWorkWith) {
  const Values two{1, 2};
  EXPECT_EQ(test::message_of<InvalidArgument>([] { (void)rank_test_p_value({}); }),
            "differences = 0 values (must be at least 1)");
  EXPECT_EQ(
      test::message_of<InvalidArgument>([&] { (void)compare_unpaired(two, Values{1}, 0.95); }),
      "second = 1 value (must be at least 2)");
  EXPECT_EQ(test::message_of<InvalidArgument>([&] { (void)compare_unpaired(two, two, 1.0); }),
            "confidence = 1 (must be in (0, 1))");
}

// Of 0.01, 0.04, 0.03, 0.005 the smallest counts four times, then 3, 2 and 1, never falling.
TEST(HolmAdjusted, ScalesFromTheSmallestOn) {
  EXPECT_THAT(holm_adjusted(Values{0.01, 0.04, 0.03, 0.005}),
              testing::ElementsAre(0.03, 0.06, 0.06, 0.02));
  EXPECT_THAT(holm_adjusted(Values{0.9, 0.8}), testing::ElementsAre(1.0, 1.0));
}

}  // namespace
}  // namespace proofmass
