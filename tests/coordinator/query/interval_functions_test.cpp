#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/query/aggregates.hpp"
#include "core/error.hpp"
#include "core/statistics/interval.hpp"
#include "tests/coordinator/query/query_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using Arguments = std::vector<std::optional<double>>;

std::optional<double> lower(const Arguments& arguments) {
  return interval_functions()[0].evaluate(arguments);
}
std::optional<double> upper(const Arguments& arguments) {
  return interval_functions()[1].evaluate(arguments);
}

std::string error_of(const Arguments& arguments) {
  try {
    (void)lower(arguments);
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return {};
}

// Of no hit among n: 1 − upper is the n-th root of 2.5 %. Of n hits: lower is that root.
TEST(IntervalFunctions, HaveTheClosedFormOfNoneAndAll) {
  for (const double n : {1.0, 2.0, 100.0, 5000.0}) {
    const double root = std::exp(std::log(0.025) / n);
    EXPECT_EQ(lower({0.0, n, 95.0}), 0.0);
    EXPECT_NEAR(*upper({0.0, n, 95.0}), 1.0 - root, 1e-12) << n;
    EXPECT_NEAR(*lower({n, n, 95.0}), root, 1e-12) << n;
    EXPECT_EQ(upper({n, n, 95.0}), 1.0);
  }
}

// One hit in two: P(X ≥ 1) = 1 − (1 − p)² = 2.5 % at the lower bound.
TEST(IntervalFunctions, HaveTheClosedFormOfOneHitInTwo) {
  EXPECT_NEAR(*lower({1.0, 2.0, 95.0}), 1.0 - std::sqrt(0.975), 1e-14);
  EXPECT_NEAR(*upper({1.0, 2.0, 95.0}), std::sqrt(0.975), 1e-14);
}

TEST(IntervalFunctions, HaveTheBitsOfTheReportsInterval) {
  const Interval interval = probability_interval(97.0, 100.0, default_confidence);
  EXPECT_EQ(lower({97.0, 100.0, 95.0}), interval.lower);
  EXPECT_EQ(upper({97.0, 100.0, 95.0}), interval.upper);
}

TEST(IntervalFunctions, AreNullWithoutRunsOrWithANull) {
  EXPECT_FALSE(lower({0.0, 0.0, 95.0}));
  EXPECT_FALSE(upper({std::nullopt, 10.0, 95.0}));
  EXPECT_FALSE(upper({1.0, std::nullopt, 95.0}));
  EXPECT_FALSE(upper({1.0, 10.0, std::nullopt}));
}

TEST(IntervalFunctions, EndAtTheMostRunsThatTheyCount) {
  EXPECT_NEAR(*lower({5e8, 1e9, 95.0}), 0.5 - 1.959963984540054 * 0.5 / std::sqrt(1e9), 2e-9);
  EXPECT_NEAR(*upper({0.0, 1e9, 95.0}), -std::log(0.025) / 1e9, 1e-17);
}

TEST(IntervalFunctions, RefuseArgumentsThatBreakTheirRule) {
  EXPECT_EQ(error_of({11.0, 10.0, 95.0}), "hits = 11 (must be a whole number in [0, 10])");
  EXPECT_EQ(error_of({-1.0, 10.0, 95.0}), "hits = -1 (must be a whole number in [0, 10])");
  EXPECT_EQ(error_of({1.5, 10.0, 95.0}), "hits = 1.5 (must be a whole number in [0, 10])");
  EXPECT_EQ(error_of({1.0, 1e308, 95.0}),
            "runs = 1e+308 (must be a whole number in [0, 1000000000])");
  EXPECT_EQ(error_of({1.0, std::numeric_limits<double>::infinity(), 95.0}),
            "runs = inf (must be a whole number in [0, 1000000000])");
  EXPECT_EQ(error_of({1.0, 10.0, 0.95}),
            "confidence = 0.95 (must be per cent in [1, 100), not a fraction)");
  EXPECT_EQ(error_of({1.0, 10.0, 100.0}),
            "confidence = 100 (must be per cent in [1, 100), not a fraction)");
}

class IntervalQuery : public test::QueryTest {};

TEST_F(IntervalQuery, ComputesThemInSql) {
  make_file(test::campaign_of(100), 100);
  const Interval interval = probability_interval(80.0, 100.0, 0.9);
  EXPECT_EQ(number_of("SELECT binomial_interval_lower(sum(run_index >= 20), count(*), 90) "
                      "FROM run_result"),
            interval.lower);
  EXPECT_EQ(number_of("SELECT binomial_interval_upper(sum(run_index >= 20), count(*), 90) "
                      "FROM run_result"),
            interval.upper);
  EXPECT_EQ(
      QueryTest::error_of("SELECT binomial_interval_upper('a', 2, 95)"),
      "sql = SELECT binomial_interval_upper('a', 2, 95) (binomial_interval_upper: hits = text "
      "or blob (must be a number))");
}

}  // namespace
}  // namespace proofmass::coordinator
