// Values that are seen in passes, against the same values in memory: every bit is the same.

#include "core/statistics/value_passes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <set>
#include <vector>

#include "core/error.hpp"

namespace proofmass {
namespace {

std::uint64_t bits(double value) { return std::bit_cast<std::uint64_t>(value); }

/// Passes over all values until there are enough; returns how many it took.
int pass_all(ValuePasses& passes, const std::vector<double>& values) {
  int num_passes = 0;
  do {
    for (const double value : values) passes.add(value);
    ++num_passes;
  } while (passes.end_pass());
  return num_passes;
}

void expect_same(const std::optional<Interval>& found, const std::optional<Interval>& expected) {
  ASSERT_EQ(found.has_value(), expected.has_value());
  if (!found) return;
  EXPECT_EQ(bits(found->lower), bits(expected->lower));
  EXPECT_EQ(bits(found->upper), bits(expected->upper));
}

void expect_those_in_memory(const ValuePasses& passes, const std::vector<double>& values,
                            const std::vector<double>& levels) {
  const Moments expected = moments(values);
  EXPECT_EQ(passes.count(), values.size());
  EXPECT_EQ(passes.largest(), *std::ranges::max_element(values));
  EXPECT_EQ(bits(passes.moments().mean), bits(expected.mean));
  EXPECT_EQ(bits(passes.moments().standard_deviation), bits(expected.standard_deviation));
  EXPECT_EQ(bits(passes.moments().rms), bits(expected.rms));
  EXPECT_EQ(bits(passes.moments().skewness), bits(expected.skewness));
  expect_same(passes.deviation_interval(),
              bootstrap_deviation_interval(values, default_confidence));
  const std::vector<double> ascending = sorted(values);
  for (const double level : levels) {
    EXPECT_EQ(bits(passes.percentile(level)), bits(percentile(ascending, level)));
    expect_same(passes.percentile_interval(level),
                percentile_interval(ascending, level, default_confidence));
  }
}

const std::vector<double> levels{0.01, 0.5, 0.9, 0.95, 0.99};

ValuePasses passes_that_keep(std::size_t num_kept) {
  return ValuePasses({.levels = levels, .has_deviation_interval = true}, num_kept);
}

/// Errors as of a campaign: of either sign, over many decades, some of them equal.
std::vector<double> mixed_values(std::size_t count) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i) {
    const double value = normal(random) * std::exp(3.0 * normal(random)) * 1e-4;
    values.push_back(i % 10 == 3 ? 0.0 : value);
  }
  return values;
}

TEST(ValuePasses, YieldTheBitsOfTheSameValuesInMemory) {
  for (const std::size_t count : {1U, 2U, 3U, 7U, 100U, 368U, 1023U, 1024U, 1025U, 5000U}) {
    const std::vector<double> values = mixed_values(count);
    for (const std::size_t num_kept : {std::size_t{0}, count - 1, count}) {
      ValuePasses passes = passes_that_keep(num_kept);
      EXPECT_EQ(pass_all(passes, values), num_kept < count ? 2 : 1);
      expect_those_in_memory(passes, values, levels);
    }
  }
}

// More values share the upper bits of their position than are kept: it takes another pass.
TEST(ValuePasses, TakeAnotherPassForValuesThatLieClose) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> close(1.0, 1.0 + 1e-3);
  std::vector<double> values(num_selected_max + 100'000);
  for (double& value : values) value = close(random);
  ValuePasses passes = passes_that_keep(100);
  EXPECT_EQ(pass_all(passes, values), 3);
  expect_those_in_memory(passes, values, levels);
}

TEST(ValuePasses, EndForValuesThatAreEqual) {
  const std::vector<double> values(num_selected_max + 1, -0.1);
  ValuePasses passes = passes_that_keep(100);
  EXPECT_EQ(pass_all(passes, values), 5) << "20, 12, 12, 12 and 8 bits";
  EXPECT_EQ(passes.percentile(0.5), -0.1);
  EXPECT_EQ(passes.moments().standard_deviation, 0.0);
}

TEST(ValuePasses, OfNothingEndAtOnce) {
  ValuePasses passes = passes_that_keep(100);
  EXPECT_FALSE(passes.end_pass());
  EXPECT_EQ(passes.count(), 0U);
}

TEST(ValuePasses, RefuseWhatIsNotFiniteAndAPassOfOtherValues) {
  ValuePasses passes = passes_that_keep(0);
  EXPECT_THROW(passes.add(std::nan("")), InvalidArgument);
  EXPECT_THROW(passes.add(std::numeric_limits<double>::infinity()), InvalidArgument);
  passes.add(1.0);
  EXPECT_TRUE(passes.end_pass());
  EXPECT_THROW((void)passes.end_pass(), InvalidArgument);
}

TEST(OrderSelection, OrdersValuesOfEitherSignAndExtremes) {
  const std::vector<double> values{3.0,    -2.0,    0.0,    -0.0, 1e300, -1e300,
                                   5e-324, -5e-324, 1e-300, 2.0,  -3.0,  2.0};
  std::set<std::size_t> places;
  for (std::size_t i = 0; i < values.size(); ++i) places.insert(i);
  OrderSelection selection;
  for (const double value : values) selection.add(value);
  bool is_another_needed = selection.end_first_pass(places);
  while (is_another_needed) {
    for (const double value : values) selection.add(value);
    is_another_needed = selection.end_pass();
  }
  const std::vector<double> ascending = sorted(values);
  for (std::size_t i = 0; i < values.size(); ++i) EXPECT_EQ(selection.value_at(i), ascending[i]);
}

}  // namespace
}  // namespace proofmass
