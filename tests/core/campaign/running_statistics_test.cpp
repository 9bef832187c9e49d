#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <optional>
#include <random>
#include <vector>

#include "core/campaign/statistics.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/statistics_in_memory.hpp"

namespace proofmass {
namespace {

/// Bias of a parameter in standard deviations: none, 0.01, 0.1, ... 10⁶.
double bias(std::size_t parameter) {
  return parameter == 0 ? 0.0 : std::pow(10.0, static_cast<double>(parameter) - 3.0);
}

/// Run `run` of a campaign; some runs have no estimate.
RunResult scattered_result_of(std::uint64_t run) {
  RunResult result = test::zero_result({.run = RunIndex{run}, .num_draws = 1, .num_rounds = 1});
  if (run % 11 == 5) result.status = RunStatus::not_finite;
  if (run % 13 == 6) result.status = RunStatus::no_draw;
  if (run % 7 == 2) result.status = RunStatus::not_converged;
  if (run % 17 == 3) result.status = RunStatus::lost;
  std::mt19937_64 generator(run);
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < num_parameters; ++i) {
    result.estimate[i] = 1e-4 * (bias(i) + normal(generator));
  }
  return result;
}

std::vector<double> wide_objectives() { return std::vector<double>(num_parameters, 2e-4); }

void expect_close(double found, double expected, double scale) {
  EXPECT_NEAR(found, expected, 1e-11 * scale);
}

void expect_close(const std::optional<Interval>& found, const std::optional<Interval>& expected,
                  double scale) {
  ASSERT_EQ(found.has_value(), expected.has_value());
  if (!found) return;
  expect_close(found->lower, expected->lower, scale);
  expect_close(found->upper, expected->upper, scale);
}

void expect_close(const AccuracyStatistic& found, const AccuracyStatistic& expected) {
  EXPECT_EQ(found.worst, expected.worst);
  EXPECT_EQ(found.worst_run, expected.worst_run);
  EXPECT_EQ(found.num_beyond_objective, expected.num_beyond_objective);
  EXPECT_EQ(found.beyond_objective, expected.beyond_objective);
  const double scale = expected.worst;
  expect_close(found.mean, expected.mean, scale);
  expect_close(found.standard_deviation, expected.standard_deviation, scale);
  expect_close(found.mean_interval, expected.mean_interval, scale);
  expect_close(found.error.bias, expected.error.bias, scale);
  expect_close(found.error.rms, expected.error.rms, scale);
  expect_close(found.error.bias_interval, expected.error.bias_interval, scale);
  expect_close(found.error.deviation_interval, expected.error.deviation_interval, scale);
  EXPECT_NEAR(found.error.skewness, expected.error.skewness, 1e-8);
  EXPECT_FALSE(found.deviation_interval.has_value());
  for (const PercentileStatistic& percentile : found.percentiles) EXPECT_EQ(percentile.level, 0.0);
}

// The expected values are those of a second method: all results in memory, in run order.
TEST(RunningStatistics, AreThoseOfAllResultsInAnyOrder) {
  for (const std::uint64_t num_runs : {1U, 2U, 40U, 3000U}) {
    test::StatisticsInMemory in_memory(wide_objectives());
    for (std::uint64_t run = 0; run < num_runs; ++run) in_memory.add(scattered_result_of(run));
    const CampaignStatistics expected = in_memory.statistics();
    std::vector<std::uint64_t> order(num_runs);
    std::iota(order.begin(), order.end(), 0U);
    std::ranges::shuffle(order, std::mt19937_64(num_runs));
    RunningStatistics running(wide_objectives());
    for (const std::uint64_t run : order) running.add(scattered_result_of(run));
    const CampaignStatistics found = running.statistics();
    EXPECT_EQ(found.num_runs, expected.num_runs);
    EXPECT_EQ(found.num_estimated, expected.num_estimated);
    EXPECT_EQ(found.num_not_converged, expected.num_not_converged);
    EXPECT_EQ(found.num_not_finite, expected.num_not_finite);
    EXPECT_EQ(found.num_no_draw, expected.num_no_draw);
    EXPECT_EQ(found.num_lost, expected.num_lost);
    EXPECT_EQ(found.num_within_objectives, expected.num_within_objectives);
    ASSERT_EQ(found.accuracy.size(), num_parameters);
    for (std::size_t i = 0; i < num_parameters; ++i) {
      expect_close(found.accuracy[i], expected.accuracy[i]);
    }
  }
}

// One value far from all others is √n standard deviations from the mean: no first value can be
// farther.
TEST(RunningStatistics, StandAFirstRunThatIsFarOff) {
  test::StatisticsInMemory in_memory(wide_objectives());
  RunningStatistics running(wide_objectives());
  for (std::uint64_t run = 0; run < 3000; ++run) {
    RunResult result = scattered_result_of(run);
    if (run == 0) result.estimate.assign(num_parameters, 1e6);
    in_memory.add(result);
    running.add(result);
  }
  for (std::size_t i = 0; i < num_parameters; ++i) {
    const AccuracyStatistic found = running.statistics().accuracy[i];
    const AccuracyStatistic expected = in_memory.statistics().accuracy[i];
    expect_close(found.mean, expected.mean, expected.worst);
    expect_close(found.standard_deviation, expected.standard_deviation, expected.worst);
  }
}

TEST(RunningStatistics, NameTheFirstOfEqualRuns) {
  RunningStatistics running(wide_objectives());
  for (const std::uint64_t run : {30U, 10U, 20U}) {
    RunResult result = test::zero_result({.run = RunIndex{run}, .num_draws = 1, .num_rounds = 1});
    result.estimate.assign(num_parameters, run == 20 ? -1.0 : 1.0);
    running.add(result);
  }
  EXPECT_EQ(running.statistics().accuracy[0].worst_run, RunIndex{10});
}

TEST(RunningStatistics, AreZeroWithoutAnEstimate) {
  RunningStatistics running(wide_objectives());
  EXPECT_EQ(running.statistics().num_runs, 0U);
  running.add(scattered_result_of(5));
  const CampaignStatistics found = running.statistics();
  EXPECT_EQ(found.num_runs, 1U);
  EXPECT_EQ(found.num_estimated, 0U);
  ASSERT_EQ(found.accuracy.size(), num_parameters);
  EXPECT_EQ(found.accuracy[0].worst, 0.0);
}

}  // namespace
}  // namespace proofmass
