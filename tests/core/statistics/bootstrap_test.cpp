#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "core/error.hpp"
#include "core/statistics/interval.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/message_of.hpp"

namespace proofmass {
namespace {

// The standard error of the deviation of normal values is σ/√(2n); the bootstrap's own estimate of
// it scatters by √(1/groups) and more in the ends. Ten per cent of the width allow three of both.
void expect_normal_width(std::size_t n, std::uint64_t seed) {
  const std::vector<double> values = test::normal_column(n, {.seed = seed});
  const auto bootstrap = bootstrap_deviation_interval(values, 0.95);
  const double deviation = moments(values).standard_deviation;
  const double width = 2.0 * 1.959964 * deviation / std::sqrt(2.0 * static_cast<double>(n));
  EXPECT_NEAR(bootstrap->upper - bootstrap->lower, width, 0.15 * width) << n;
  EXPECT_NEAR(bootstrap->lower, deviation - 0.5 * width, 0.15 * width) << n;
}

TEST(BootstrapDeviationInterval, HasTheWidthOfNormalValues) { expect_normal_width(1000, 21); }

// 10 007 is no multiple of the number of groups.
TEST(BootstrapDeviationInterval, DrawsGroupsOfManyValues) { expect_normal_width(10'007, 22); }

TEST(BootstrapDeviationInterval, IsTheSameEveryTime) {
  const std::vector<double> values = test::half_normal_column(100, {.seed = 23});
  const auto first = bootstrap_deviation_interval(values, 0.95);
  const auto second = bootstrap_deviation_interval(values, 0.95);
  EXPECT_EQ(first->lower, second->lower);
  EXPECT_EQ(first->upper, second->upper);
}

TEST(BootstrapDeviationInterval, ScalesWithTheValues) {
  std::vector<double> values = test::half_normal_column(100, {.seed = 24});
  const auto plain = bootstrap_deviation_interval(values, 0.9);
  for (double& value : values) value *= 0x1p-40;
  const auto scaled = bootstrap_deviation_interval(values, 0.9);
  EXPECT_EQ(scaled->lower, plain->lower * 0x1p-40);
  EXPECT_EQ(scaled->upper, plain->upper * 0x1p-40);
}

TEST(BootstrapDeviationInterval, IsWiderWithMoreConfidence) {
  const std::vector<double> values = test::half_normal_column(200, {.seed = 25});
  const auto narrow = bootstrap_deviation_interval(values, 0.8);
  const auto wide = bootstrap_deviation_interval(values, 0.99);
  EXPECT_LT(wide->lower, narrow->lower);
  EXPECT_GT(wide->upper, narrow->upper);
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

TEST(BootstrapDeviationInterval, NeedsThreeValues) {
  EXPECT_FALSE(bootstrap_deviation_interval(std::vector<double>{1.0, 2.0}, 0.95).has_value());
  EXPECT_TRUE(bootstrap_deviation_interval(std::vector<double>{1.0, 2.0, 4.0}, 0.95).has_value());
}

TEST(BootstrapDeviationInterval, RefusesWhatItCannotWorkWith) {
  const std::vector<double> values{1.0, 2.0, std::numeric_limits<double>::infinity()};
  EXPECT_EQ(
      test::message_of<InvalidArgument>([&] { (void)bootstrap_deviation_interval(values, 0.95); }),
      "values[2] = inf (must be finite)");
  EXPECT_EQ(
      test::message_of<InvalidArgument>([&] { (void)bootstrap_deviation_interval(values, 0.0); }),
      "confidence = 0 (must be in (0, 1))");
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

}  // namespace
}  // namespace proofmass
