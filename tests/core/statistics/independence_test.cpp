#include "core/statistics/independence.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "core/error.hpp"
#include "core/random/normal.hpp"
#include "tests/core/statistics/columns.hpp"

namespace proofmass {
namespace {

using Values = std::vector<double>;

/// In an order of their own.
Values shuffled(Values values, std::uint64_t repetition) {
  const Values keys = test::uniform_column(values.size(), {.seed = 92, .repetition = repetition});
  std::vector<std::pair<double, double>> pairs;
  for (std::size_t i = 0; i < values.size(); ++i) pairs.emplace_back(keys[i], values[i]);
  std::ranges::sort(pairs);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = pairs[i].second;
  return values;
}

/// A Latin hypercube has one value in each of n equal parts of its range, in any order.
Values latin_hypercube(std::size_t count, std::uint64_t repetition) {
  Values values = test::uniform_column(count, {.seed = 91, .repetition = repetition});
  for (std::size_t i = 0; i < count; ++i) {
    values[i] = (static_cast<double>(i) + values[i]) / static_cast<double>(count);
  }
  return shuffled(values, repetition);
}

/// The first column of Sobol' points: the bits of the row, mirrored at the point.
Values sobol(std::size_t count) {
  Values values(count);
  for (std::size_t i = 0; i < count; ++i) {
    double digit = 0.5;
    for (std::size_t rest = i; rest > 0; rest /= 2, digit /= 2.0) {
      if (rest % 2 == 1) values[i] += digit;
    }
  }
  return values;
}

bool is_refused(const Values& values) {
  const IndependencePValues p_values = independence_p_values(values);
  return std::min(p_values.serial, p_values.regular) < independence_p_value_min;
}

// Two tests of 1e-4 refuse 0.2 of 1,000 columns; three are a chance of 0.1 %.
TEST(Independence, IsRarelyDeniedToIndependentDraws) {
  const auto rounded = [](double u) { return std::round(300.0 * u); };
  const auto exponential = [](double u) { return -std::log(u); };
  const auto bimodal = [](double u) { return u < 0.3 ? u : 5.0 + 0.01 * inverse_normal(u); };
  for (const std::size_t count : {50U, 500U}) {
    int num_refused = 0;
    for (std::uint64_t repetition = 0; repetition < 200; ++repetition) {
      const auto of = [&](std::uint32_t column) {
        return test::Selection{.seed = 93, .repetition = repetition, .column = column};
      };
      for (const Values& values :
           {test::uniform_column(count, of(0)), test::normal_column(count, of(1)),
            test::column_of(count, of(2), rounded), test::column_of(count, of(3), exponential),
            test::column_of(count, of(4), bimodal)}) {
        if (is_refused(values)) ++num_refused;
      }
    }
    EXPECT_LE(num_refused, 2) << count;
  }
}

TEST(Independence, IsDeniedToDesigns) {
  int num_refused = 0;
  for (std::uint64_t repetition = 0; repetition < 100; ++repetition) {
    if (is_refused(latin_hypercube(100, repetition))) ++num_refused;
    Values normal = latin_hypercube(200, repetition);
    for (double& value : normal) value = inverse_normal(value);
    EXPECT_TRUE(is_refused(normal)) << repetition;
  }
  EXPECT_GE(num_refused, 85);
  EXPECT_TRUE(is_refused(sobol(100)));
  EXPECT_TRUE(is_refused(shuffled(sobol(100), 1)));
  Values grid(100), levels(100), series = test::normal_column(200, {.seed = 94});
  for (std::size_t i = 0; i < grid.size(); ++i) grid[i] = static_cast<double>(i);
  for (std::size_t i = 0; i < levels.size(); ++i) levels[i] = static_cast<double>(i % 10);
  for (std::size_t i = 1; i < series.size(); ++i) series[i] += 0.5 * series[i - 1];
  EXPECT_TRUE(is_refused(grid));
  EXPECT_TRUE(is_refused(shuffled(grid, 2)));
  EXPECT_TRUE(is_refused(shuffled(levels, 3)));
  EXPECT_TRUE(is_refused(series));
}

TEST(Independence, IsNotTestedOfFewValuesOrOfOneValue) {
  EXPECT_FALSE(is_refused({1.0, 2.0, 3.0}));
  EXPECT_FALSE(is_refused(Values(100, 7.0)));
  EXPECT_THROW((void)independence_p_values(Values{1.0, NAN}), InvalidArgument);
}

}  // namespace
}  // namespace proofmass
