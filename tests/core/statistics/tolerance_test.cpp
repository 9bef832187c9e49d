#include "core/statistics/tolerance.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/error.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/message_of.hpp"

namespace proofmass {
namespace {

struct PublishedRuns {
  double coverage, confidence;
  std::vector<std::uint64_t> num_runs;  ///< For orders 1, 2, 3 ...
};

// Tables for one-sided limits: [Wilks1941] and its use in reactor safety (59, 93, 124 and on).
TEST(WilksOrder, IsThatOfThePublishedNumbersOfRuns) {
  const std::vector<PublishedRuns> table{
      {0.95, 0.95, {59, 93, 124, 153, 181, 208, 234, 260, 286, 311}},
      {0.95, 0.99, {90, 130, 165, 198, 229}},
      {0.90, 0.95, {29, 46, 61, 76, 89, 103}},
      {0.99, 0.95, {299, 473, 628, 773, 913}},
      {0.99, 0.99, {459, 662, 838}}};
  for (const PublishedRuns& row : table) {
    for (std::size_t i = 0; i < row.num_runs.size(); ++i) {
      const Tolerance tolerance{row.coverage, row.confidence};
      EXPECT_EQ(wilks_order(tolerance, row.num_runs[i]), i + 1) << row.num_runs[i];
      EXPECT_EQ(wilks_order(tolerance, row.num_runs[i] - 1), i) << row.num_runs[i];
    }
  }
}

// A million runs against 99.9 %: 1000 are expected above, less 1.645 deviations of 31.6.
TEST(WilksOrder, OfAMillionRunsIsThatOfTheNormalLaw) {
  EXPECT_NEAR(static_cast<double>(wilks_order({0.999, 0.95}, 1'000'000)), 1000.0 - 52.0, 2.0);
}

TEST(WilksUpper, NamesTheValueItsOrderAndItsPlace) {
  std::vector<double> values(124);
  for (std::size_t i = 0; i < values.size(); ++i) values[(i * 7) % 124] = static_cast<double>(i);
  const auto bound = wilks_upper(values, {0.95, 0.95});
  EXPECT_EQ(bound->value, 121.0);  // The third of 123, 122, 121.
  EXPECT_EQ(bound->order, 3u);
  EXPECT_EQ(bound->index, (121 * 7) % 124u);
}

TEST(WilksUpper, CountsUnknownValuesAsTheLargest) {
  const std::vector<double> values = test::uniform_column(122, {.seed = 4});
  std::vector<double> with_largest = values;
  with_largest.insert(with_largest.end(), {7.0, 7.0});
  EXPECT_EQ(wilks_upper(values, {0.95, 0.95}, 2)->value,
            wilks_upper(with_largest, {0.95, 0.95})->value);
  EXPECT_FALSE(wilks_upper(values, {0.95, 0.95}, 6).has_value());
}

// The third largest of 124 is the bound: with two unknown ones that is the largest of the others,
// with three it is unknown itself.
TEST(WilksUpper, IsEmptyOnceUnknownValuesReachItsOrder) {
  const std::vector<double> values = test::uniform_column(122, {.seed = 5});
  const auto bound = wilks_upper(values, {0.95, 0.95}, 2);
  ASSERT_TRUE(bound.has_value());
  EXPECT_EQ(bound->value, *std::max_element(values.begin(), values.end()));
  EXPECT_FALSE(wilks_upper(std::span(values).first(121), {0.95, 0.95}, 3).has_value());
}

TEST(WilksUpper, IsAtTheFirstOfEqualValues) {
  std::vector<double> values(59, 1.0);
  values[20] = values[10] = 2.0;
  EXPECT_EQ(wilks_upper(values, {0.95, 0.95})->index, 10u);
}

TEST(WilksUpper, IsEmptyWithTooFewValues) {
  EXPECT_FALSE(wilks_upper(std::vector<double>(58, 1.0), {0.95, 0.95}).has_value());
  EXPECT_TRUE(wilks_upper(std::vector<double>(59, 1.0), {0.95, 0.95}).has_value());
}

TEST(Tolerance, RefusesFractionsOutsideTheirRange) {
  EXPECT_EQ(test::message_of<InvalidArgument>([] {
              (void)wilks_order({1.0, 0.95}, 10);
            }),
            "coverage = 1 (must be in (0, 1))");
  EXPECT_EQ(test::message_of<InvalidArgument>([] {
              (void)wilks_order({0.95, 0.0}, 10);
            }),
            "confidence = 0 (must be in (0, 1))");
}

}  // namespace
}  // namespace proofmass
