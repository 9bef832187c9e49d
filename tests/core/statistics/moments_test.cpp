#include "core/statistics/moments.hpp"

#include "core/error.hpp"
#include "core/statistics/comparison.hpp"
#include "core/statistics/correlation.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/order.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

TEST(Moments, OfEqualValuesHaveNoSpread) {
  const Moments about = moments(std::vector<double>(1000, 0.1));
  EXPECT_EQ(about.mean, 0.1);
  EXPECT_EQ(about.standard_deviation, 0.0);
  EXPECT_EQ(about.skewness, 0.0);
  EXPECT_EQ(about.excess_kurtosis, 0.0);
}

TEST(Moments, HaveNoSkewnessOfTwoValuesAndNoKurtosisOfThree) {
  EXPECT_EQ(moments(std::vector<double>{1.0, 4.0}).skewness, 0.0);
  EXPECT_EQ(moments(std::vector<double>{1.0, 4.0, 5.0}).excess_kurtosis, 0.0);
}

// Fourth powers of these values are no doubles, and for the smallest two not even squares.
TEST(Moments, OfAnyScaleHaveTheSameShape) {
  const std::vector<double> values = test::normal_column(100, {.seed = 11});
  const Moments about = moments(values);
  const std::optional<Interval> spread = bootstrap_deviation_interval(values, 0.95);
  for (const double scale : {0x1p300, 0x1p-300, 0x1p-600, 0x1p-1000}) {
    std::vector<double> scaled = values;
    std::ranges::for_each(scaled, [&](double& value) { value *= scale; });
    const Moments same = moments(scaled);
    EXPECT_EQ(same.mean, scale * about.mean);
    EXPECT_EQ(same.standard_deviation, scale * about.standard_deviation);
    EXPECT_EQ(same.rms, scale * about.rms);
    EXPECT_EQ(same.skewness, about.skewness);
    EXPECT_EQ(same.excess_kurtosis, about.excess_kurtosis);
    const std::optional<Interval> interval = bootstrap_deviation_interval(scaled, 0.95);
    EXPECT_EQ(interval->lower, scale * spread->lower);
    EXPECT_EQ(interval->upper, scale * spread->upper);
  }
}

// A centre from before the values were known may be of another size than they are.
TEST(Moments, SeenOneByOneMayBeFarAboveTheirCentre) {
  std::vector<double> values = test::normal_column(100, {.seed = 12});
  std::ranges::for_each(values, [](double& value) { value *= 1e60; });
  values[0] = 1e-90;
  for (const double centre : {0.0, values[0]}) {
    MomentSums sums(centre);
    for (const double value : values) sums.add(value);
    const Moments seen = sums.moments(), about = moments(values);
    EXPECT_NEAR(seen.mean, about.mean, 1e-15 * about.standard_deviation);
    EXPECT_NEAR(seen.standard_deviation, about.standard_deviation,
                1e-15 * about.standard_deviation);
    EXPECT_NEAR(seen.skewness, about.skewness, 1e-13);
    EXPECT_NEAR(seen.excess_kurtosis, about.excess_kurtosis, 1e-13);
  }
}

TEST(CompensatedSum, KeepsWhatAPlainSumLoses) {
  const std::vector<double> terms{1.0, 1e16, 1.0, -1e16};
  double plain = 0.0;
  for (const double term : terms) plain += term;
  EXPECT_EQ(compensated_sum(terms), 2.0);
  EXPECT_EQ(plain, 0.0);
}

TEST(AscendingOrder, KeepsTheOrderOfEqualValues) {
  EXPECT_THAT(ascending_order(std::vector<double>{3.0, 1.0, 3.0, 1.0}), ElementsAre(1, 3, 0, 2));
}

TEST(Binomial, TailsBeyondItsCountsAreEmpty) {
  EXPECT_EQ(binomial_at_most(-1.0, 12.0, 0.3), 0.0);
  EXPECT_EQ(binomial_at_least(13.0, 12.0, 0.3), 0.0);
}

// Both series hold for every x; they meet at 1.
TEST(KolmogorovUpper, IsContinuousAndEndsAtOneAndZero) {
  EXPECT_NEAR(kolmogorov_upper(std::nextafter(1.0, 0.0)), kolmogorov_upper(1.0), 1e-15);
  EXPECT_EQ(kolmogorov_upper(0.0), 1.0);
  EXPECT_GE(kolmogorov_upper(40.0), 0.0);
}

using Values = std::vector<double>;

// Around 2⁵³ only even numbers are doubles: the mean, M + 1, is rounded to M.
TEST(LinearCorrelation, IsZeroOfPatternsWhoseMeanIsNoDouble) {
  constexpr double m = 0x1p53;
  const Values x{m, m, m + 2, m + 2};
  const Values y{m, m + 2, m, m + 2};
  EXPECT_EQ(linear_correlation(x, y), 0.0);
}

TEST(Correlations, AreEmptyWithoutVariationOrValues) {
  const Values constant(5, 2.0);
  const Values x{1, 2, 3, 4, 5};
  EXPECT_FALSE(linear_correlation(x, constant).has_value());
  EXPECT_FALSE(rank_correlation(constant, x).has_value());
  EXPECT_FALSE(linear_correlation(Values{1, 2, 3}, Values{3, 1, 2}).has_value());
  EXPECT_FALSE(rank_correlation(Values{1, 2, 3}, Values{3, 1, 2}).has_value());
}

TEST(Statistics, RefuseWhatTheyCannotWorkWith) {
  const Values two{1, 2}, four{1, 2, 3, 4};
  const Values broken{1, 2, std::numeric_limits<double>::quiet_NaN(), 4};
  const Moments about = moments(four);
  const std::string not_a_fraction = "confidence = 95 (must be in (0, 1))";
  const std::vector<std::pair<std::function<void()>, std::string>> cases{
      {[&] { (void)moments({}); }, "values = 0 values (must be at least 1)"},
      {[&] { (void)moments(broken); }, "values[2] = nan (must be finite)"},
      {[&] { (void)percentile({}, 0.5); }, "values = 0 values (must be at least 1)"},
      {[&] { (void)percentile(two, 1.5); }, "level = 1.5 (must be in [0, 1])"},
      {[&] { (void)linear_correlation(four, two); },
       "y = 2 values (must be as many as the others, 4)"},
      {[&] { (void)rank_correlation(four, broken); }, "y[2] = nan (must be finite)"},
      {[&] { (void)rank_test_p_value({}); }, "differences = 0 values (must be at least 1)"},
      {[&] { (void)compare_unpaired(two, Values{1}, 0.95); },
       "second = 1 value (must be at least 2)"},
      {[&] { (void)compare_unpaired(two, two, 95.0); }, not_a_fraction},
      {[&] { (void)mean_interval(about, 95.0); }, not_a_fraction},
      {[&] { (void)deviation_interval(about, 95.0); }, not_a_fraction},
      {[&] { (void)percentile_interval(four, 0.5, 95.0); }, not_a_fraction},
      {[&] { (void)percentile_interval(four, 1.0, 0.95); }, "level = 1 (must be in (0, 1))"},
      {[&] { (void)probability_interval(1, 2, 95.0); }, not_a_fraction},
      {[&] { (void)bootstrap_deviation_interval(broken, 0.95); },
       "values[2] = nan (must be finite)"},
      {[&] { (void)bootstrap_deviation_interval(four, 95.0); }, not_a_fraction}};
  for (const auto& [call, message] : cases) {
    EXPECT_EQ(test::message_of<InvalidArgument>(call), message);
  }
}

}  // namespace
}  // namespace proofmass
