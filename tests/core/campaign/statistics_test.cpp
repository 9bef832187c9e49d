#include "core/campaign/statistics.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace proofmass {
namespace {

using enum Parameter;

/// A completed run whose errors are all `error`; the truth is 0, so that they are exact.
RunResult run_with_error(std::uint64_t run, double error) {
  RunResult result{.run = RunIndex{run}, .num_draws = 1, .num_rounds = 1};
  result.estimate.fill(error);
  return result;
}

CampaignStatistics statistics_of(const std::vector<double>& errors, double objective = 1.0) {
  ParameterArray objectives;
  objectives.fill(objective);
  StatisticsAccumulator accumulator(objectives);
  for (std::size_t run = 0; run < errors.size(); ++run) {
    accumulator.add(run_with_error(run, errors[run]));
  }
  return accumulator.statistics();
}

// |error| = 1, 2, 3, 4: mean 2.5, squared deviations 2.25 + 0.25 + 0.25 + 2.25 = 5, over n − 1 = 3.
TEST(Statistics, AreThoseOfTheAbsoluteError) {
  const CampaignStatistics statistics = statistics_of({1.0, -2.0, 3.0, -4.0});
  for (const AccuracyStatistic& accuracy : statistics.accuracy) {
    EXPECT_EQ(accuracy.worst, 4.0);
    EXPECT_EQ(accuracy.worst_run, RunIndex{3});
    EXPECT_EQ(accuracy.mean, 2.5);
    EXPECT_DOUBLE_EQ(accuracy.standard_deviation, std::sqrt(5.0 / 3.0));
  }
}

TEST(Statistics, TakeTheErrorAgainstTheTruth) {
  StatisticsAccumulator accumulator(ParameterArray{});
  RunResult result = run_with_error(0, 0.0);
  result.truth[index(k2d)] = 100.0;
  result.estimate[index(k2d)] = 75.0;
  accumulator.add(result);
  EXPECT_EQ(accumulator.statistics().accuracy[index(k2d)].worst, 25.0);
  EXPECT_EQ(accumulator.statistics().accuracy[index(k2c)].worst, 0.0);
}

TEST(Statistics, OfASingleRunHaveNoSpread) {
  const AccuracyStatistic accuracy = statistics_of({-3.0}).accuracy[index(a_c12)];
  EXPECT_EQ(accuracy.worst, 3.0);
  EXPECT_EQ(accuracy.mean, 3.0);
  EXPECT_EQ(accuracy.standard_deviation, 0.0);
}

TEST(Statistics, OfNoRunAreZero) {
  const CampaignStatistics statistics = statistics_of({});
  EXPECT_EQ(statistics.num_runs, 0u);
  EXPECT_EQ(statistics.accuracy[index(a_c12)].worst, 0.0);
  EXPECT_EQ(statistics.accuracy[index(a_c12)].mean, 0.0);
}

TEST(Statistics, CountRunsBeyondTheObjectiveButNotThoseOnIt) {
  EXPECT_EQ(statistics_of({0.5, -1.0, 1.5, -2.5}).accuracy[index(a_d12)].num_beyond_objective, 2u);
}

TEST(Statistics, NameTheFirstOfSeveralWorstRuns) {
  EXPECT_EQ(statistics_of({1.0, -7.0, 7.0}).accuracy[index(a_c12)].worst_run, RunIndex{1});
}

TEST(Statistics, CountEveryStatusAndLeaveOutRunsWithoutEstimate) {
  StatisticsAccumulator accumulator(ParameterArray{});
  constexpr std::array statuses{RunStatus::completed, RunStatus::not_converged,
                                RunStatus::not_converged, RunStatus::not_finite,
                                RunStatus::no_draw};
  for (std::size_t i = 0; i < statuses.size(); ++i) {
    RunResult result = run_with_error(10 * i, static_cast<double>(i) + 1.0);
    result.status = statuses[i];
    accumulator.add(result);
  }
  const CampaignStatistics statistics = accumulator.statistics();
  EXPECT_EQ(statistics.num_runs, 5u);
  EXPECT_EQ(statistics.num_estimated, 3u);
  EXPECT_EQ(statistics.num_not_converged, 2u);
  EXPECT_EQ(statistics.num_not_finite, 1u);
  EXPECT_EQ(statistics.num_no_draw, 1u);
  EXPECT_EQ(statistics.accuracy[index(a_c12)].worst, 3.0);
  EXPECT_EQ(statistics.accuracy[index(a_c12)].worst_run, RunIndex{20});
}

// A plain sum of these returns 0: the first 1 drowns in 1e16, and with it goes all that is left.
TEST(Statistics, CompensatedSumKeepsWhatAPlainSumLoses) {
  CompensatedSum sum;
  double plain = 0.0;
  for (const double term : {1.0, 1e16, 1.0, -1e16}) {
    sum.add(term);
    plain += term;
  }
  EXPECT_EQ(sum.value(), 2.0);
  EXPECT_EQ(plain, 0.0);
}

// 10⁵ errors 1e8 ± 1e-4 in equal numbers. Their mean is 1e8, their deviation 1e-4·√(n/(n − 1)); the
// one-pass formula would subtract numbers of 1e16 that agree in 24 digits. 1e8 ± 1e-4 itself is
// stored to 2⁻²⁷ = 7.5e-9, which is 7.5e-5 of the deviation.
TEST(Statistics, ResolveASpreadFarBelowTheMean) {
  constexpr std::size_t n = 100'000;
  std::vector<double> errors(n);
  for (std::size_t i = 0; i < n; ++i) errors[i] = i % 2 == 0 ? 1e8 + 1e-4 : 1e8 - 1e-4;
  const AccuracyStatistic accuracy = statistics_of(errors).accuracy[index(a_c12)];
  EXPECT_NEAR(accuracy.mean, 1e8, 1.5e-8);  // Half a unit in the last place of 1e8, twice.
  EXPECT_NEAR(accuracy.standard_deviation / 1e-4, std::sqrt(n / (n - 1.0)), 7.5e-5);
}

TEST(StatisticsDeathTest, RefusesRunsOutOfOrder) {
  StatisticsAccumulator accumulator(ParameterArray{});
  accumulator.add(run_with_error(5, 0.0));
  EXPECT_DEATH(accumulator.add(run_with_error(5, 0.0)), "internal invariant broken");
}

TEST(CampaignStatistics, YieldTheWorstAndMeanErrorsAsArrays) {
  const CampaignStatistics statistics = statistics_of({1.0, -3.0});
  EXPECT_EQ(statistics.worst_errors()[index(k2c)], 3.0);
  EXPECT_EQ(statistics.mean_errors()[index(k2c)], 2.0);
}

}  // namespace
}  // namespace proofmass
