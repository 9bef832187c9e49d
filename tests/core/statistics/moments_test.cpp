#include "core/statistics/moments.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/error.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/message_of.hpp"

namespace proofmass {
namespace {

// 2, 4, 4, 4, 5, 5, 7, 9: mean 5, squares of differences 32 over n − 1 = 7; raw squares 232 over 8;
// cubes −27 − 3 + 8 + 64 = 42, so g1 = (42/8)/2³ and G1 = g1 √56/6; fourth powers
// 81 + 3 + 16 + 256 = 356, so g2 = (356/8)/2⁴ − 3 and G2 = (9 g2 + 6) 7/30.
TEST(Moments, OfEightNumbersAreThoseOfPaperAndPencil) {
  const Moments about = moments(std::vector<double>{2, 4, 4, 4, 5, 5, 7, 9});
  EXPECT_EQ(about.count, 8u);
  EXPECT_EQ(about.mean, 5.0);
  EXPECT_DOUBLE_EQ(about.standard_deviation, std::sqrt(32.0 / 7.0));
  EXPECT_DOUBLE_EQ(about.rms, std::sqrt(29.0));
  EXPECT_DOUBLE_EQ(about.skewness, 42.0 / 8.0 / 8.0 * std::sqrt(56.0) / 6.0);
  EXPECT_DOUBLE_EQ(about.excess_kurtosis, (9.0 * (356.0 / 8.0 / 16.0 - 3.0) + 6.0) * 7.0 / 30.0);
}

TEST(Moments, OfASingleValueHaveNoSpread) {
  const Moments about = moments(std::vector<double>{-3.0});
  EXPECT_EQ(about.mean, -3.0);
  EXPECT_EQ(about.standard_deviation, 0.0);
  EXPECT_EQ(about.rms, 3.0);
  EXPECT_EQ(about.skewness, 0.0);
}

TEST(Moments, OfEqualValuesHaveNoSpread) {
  const Moments about = moments(std::vector<double>(1000, 0.1));
  EXPECT_EQ(about.mean, 0.1);
  EXPECT_EQ(about.standard_deviation, 0.0);
  EXPECT_EQ(about.skewness, 0.0);
  EXPECT_EQ(about.excess_kurtosis, 0.0);
}

// Multiples of 2⁻²⁶ below 1 can be added to 1e8 exactly, so the shifted values have the same
// central moments. The mean near 1e8 is only known to 7e-9, a ten-thousandth of this spread of
// 6e-5; without its correction the skewness would be off by as much.
TEST(Moments, DoNotFeelAnOffsetOf1e8) {
  std::vector<double> values = test::uniform_column(10'001, {.seed = 8});
  std::vector<double> shifted;
  for (double& value : values) {
    value = std::floor(value * value * 0x1p14) * 0x1p-26;
    shifted.push_back(1e8 + value);
  }
  const Moments plain = moments(values);
  const Moments far = moments(shifted);
  EXPECT_NEAR(far.standard_deviation / plain.standard_deviation, 1.0, 1e-15);
  EXPECT_NEAR(far.skewness / plain.skewness, 1.0, 1e-14);
  EXPECT_NEAR(far.excess_kurtosis / plain.excess_kurtosis, 1.0, 1e-14);
  EXPECT_EQ(far.mean, 1e8 + plain.mean);
}

TEST(Moments, DoNotFeelAScale) {
  std::vector<double> values = test::normal_column(1000, {.seed = 9});
  const Moments plain = moments(values);
  std::ranges::for_each(values, [](double& value) { value *= 0x1p-60; });
  const Moments scaled = moments(values);
  EXPECT_EQ(scaled.standard_deviation, plain.standard_deviation * 0x1p-60);
  EXPECT_EQ(scaled.skewness, plain.skewness);
  EXPECT_EQ(scaled.excess_kurtosis, plain.excess_kurtosis);
}

TEST(Moments, ChangeSignWithTheValues) {
  std::vector<double> values = test::half_normal_column(1000, {.seed = 10});
  const Moments plain = moments(values);
  std::ranges::for_each(values, [](double& value) { value = -value; });
  EXPECT_EQ(moments(values).mean, -plain.mean);
  EXPECT_EQ(moments(values).skewness, -plain.skewness);
}

TEST(Moments, HaveNoSkewnessOfTwoValuesAndNoKurtosisOfThree) {
  EXPECT_EQ(moments(std::vector<double>{1.0, 4.0}).skewness, 0.0);
  EXPECT_EQ(moments(std::vector<double>{1.0, 4.0, 5.0}).excess_kurtosis, 0.0);
}

// The fourth powers of 1e80 and of 1e-90 are no doubles.
TEST(Moments, HaveNoKurtosisBeyondTheRangeOfDoubles) {
  for (const double scale : {1e80, 1e-90}) {
    std::vector<double> values = test::normal_column(100, {.seed = 11});
    std::ranges::for_each(values, [&](double& value) { value *= scale; });
    EXPECT_EQ(moments(values).excess_kurtosis, 0.0) << scale;
  }
}

TEST(Moments, RefuseNoValues) {
  EXPECT_EQ(test::message_of<InvalidArgument>([] { (void)moments({}); }),
            "values = 0 values (must be at least 1)");
}

TEST(Moments, RefuseAValueThatIsNotFinite) {
  const std::vector<double> values{1.0, std::numeric_limits<double>::quiet_NaN()};
  EXPECT_EQ(test::message_of<InvalidArgument>([&] { (void)moments(values); }),
            "values[1] = nan (must be finite)");
}

// A plain sum of these returns 0: the first 1 drowns in 1e16, and with it goes all that is left.
TEST(CompensatedSum, KeepsWhatAPlainSumLoses) {
  const std::vector<double> terms{1.0, 1e16, 1.0, -1e16};
  double plain = 0.0;
  for (const double term : terms) plain += term;
  EXPECT_EQ(compensated_sum(terms), 2.0);
  EXPECT_EQ(plain, 0.0);
}

TEST(CompensatedSum, OfNothingIsZero) { EXPECT_EQ(compensated_sum({}), 0.0); }

}  // namespace
}  // namespace proofmass
