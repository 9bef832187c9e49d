#include "core/campaign/statistics.hpp"

#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/statistics_of.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

using enum Parameter;

/// A completed run whose errors are all `error`; the truth is 0, so that they are exact.
RunResult run_with_error(std::uint64_t run, double error) {
  RunResult result = test::zero_result({.run = RunIndex{run}, .num_draws = 1, .num_rounds = 1});
  result.estimate.assign(num_parameters, error);
  return result;
}

CampaignStatistics statistics_of(const std::vector<RunResult>& results) {
  return test::statistics_of(std::vector<double>(num_parameters, 1.0), results);
}

CampaignStatistics statistics_of_errors(const std::vector<double>& errors) {
  std::vector<RunResult> results;
  for (std::size_t run = 0; run < errors.size(); ++run) {
    results.push_back(run_with_error(run, errors[run]));
  }
  return statistics_of(results);
}

TEST(Statistics, HaveTheHealthOfRunsWithAnEstimate) {
  std::vector<RunResult> results;
  for (const double health : {1.0, 5.0, 3.0}) {
    results.push_back(run_with_error(results.size(), 1.0));
    results.back().health = {health, 0.25};
  }
  results.push_back(run_with_error(3, 1.0));  // By a program that knew no health.
  results.push_back(test::zero_result({.run = {4}, .status = RunStatus::lost}));
  results.back().health = {9.0, 9.0};
  const CampaignStatistics statistics = statistics_of(results);
  ASSERT_EQ(statistics.health.size(), 2U);
  EXPECT_EQ(statistics.health[0].worst, 5.0);
  EXPECT_EQ(statistics.health[0].mean, 3.0);
  EXPECT_EQ(statistics.health[1].mean, 0.25);
}

TEST(Statistics, CountEveryStatusAndLeaveOutRunsThatAreNotCompleted) {
  std::vector<RunResult> results;
  constexpr std::array statuses{RunStatus::completed, RunStatus::not_converged,
                                RunStatus::not_converged, RunStatus::not_finite,
                                RunStatus::no_draw};
  for (std::size_t i = 0; i < statuses.size(); ++i) {
    RunResult result = run_with_error(10 * i, static_cast<double>(i) + 1.0);
    result.status = statuses[i];
    results.push_back(result);
  }
  const CampaignStatistics statistics = statistics_of(results);
  EXPECT_EQ(statistics.num_runs, 5u);
  EXPECT_EQ(statistics.num_estimated, 1u);
  EXPECT_EQ(statistics.num_not_converged, 2u);
  EXPECT_EQ(statistics.num_not_finite, 1u);
  EXPECT_EQ(statistics.num_no_draw, 1u);
  EXPECT_EQ(statistics.accuracy[index(a_c12)].worst, 1.0);
  EXPECT_EQ(statistics.accuracy[index(a_c12)].worst_run, RunIndex{0});
}

// 10⁵ errors 1e8 ± 1e-4 in equal numbers. Their mean is 1e8, their deviation 1e-4·√(n/(n − 1)); the
// one-pass formula would subtract numbers of 1e16 that agree in 24 digits. 1e8 ± 1e-4 itself is
// stored to 2⁻²⁷ = 7.5e-9, which is 7.5e-5 of the deviation.
TEST(Statistics, ResolveASpreadFarBelowTheMean) {
  constexpr std::size_t n = 100'000;
  std::vector<double> errors(n);
  for (std::size_t i = 0; i < n; ++i) errors[i] = i % 2 == 0 ? 1e8 + 1e-4 : 1e8 - 1e-4;
  const AccuracyStatistic accuracy = statistics_of_errors(errors).accuracy[index(a_c12)];
  EXPECT_NEAR(accuracy.mean, 1e8, 1.5e-8);  // Half a unit in the last place of 1e8, twice.
  EXPECT_NEAR(accuracy.standard_deviation / 1e-4, std::sqrt(n / (n - 1.0)), 7.5e-5);
}

// Each is what the functions of core/statistics say of the errors or of their magnitudes.
TEST(Statistics, HaveIntervalsOfErrorsAndMagnitudes) {
  std::vector<double> errors, magnitudes;
  for (int i = 0; i <= 1000; ++i) {
    errors.push_back(i % 3 == 0 ? -i : i);
    magnitudes.push_back(i);
  }
  const AccuracyStatistic accuracy = statistics_of_errors(errors).accuracy[index(k2c)];
  EXPECT_EQ(accuracy.mean_interval, mean_interval(moments(magnitudes), default_confidence));
  EXPECT_EQ(accuracy.deviation_interval,
            bootstrap_deviation_interval(magnitudes, default_confidence));
  EXPECT_EQ(accuracy.error.bias_interval, mean_interval(moments(errors), default_confidence));
  EXPECT_EQ(accuracy.error.deviation_interval,
            deviation_interval(moments(errors), default_confidence));
  constexpr std::array expected{500.0, 900.0, 950.0, 990.0};
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const PercentileStatistic& found = accuracy.percentiles[i];
    EXPECT_EQ(found.level, percentile_levels[i]);
    EXPECT_NEAR(found.value, expected[i], 1e-9);
    EXPECT_EQ(found.interval, percentile_interval(magnitudes, found.level, default_confidence));
  }
}

TEST(Statistics, OfASingleRunHaveNoIntervals) {
  const AccuracyStatistic accuracy = statistics_of_errors({-3.0}).accuracy[index(a_c12)];
  EXPECT_FALSE(accuracy.mean_interval.has_value());
  EXPECT_FALSE(accuracy.deviation_interval.has_value());
  EXPECT_FALSE(accuracy.percentiles[0].interval.has_value());
  EXPECT_EQ(accuracy.percentiles[0].value, 3.0);
  EXPECT_EQ(accuracy.error.bias, -3.0);
  EXPECT_FALSE(accuracy.error.bias_interval.has_value());
}

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

// The expected values are those of all errors at once, in run order.
TEST(RunningStatistics, AreThoseOfAllResultsInAnyOrder) {
  for (const std::uint64_t num_runs : {1U, 2U, 40U, 3000U}) {
    std::vector<RunResult> results;
    for (std::uint64_t run = 0; run < num_runs; ++run) results.push_back(scattered_result_of(run));
    const CampaignStatistics expected = test::statistics_of(wide_objectives(), results);
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
  std::vector<RunResult> results;
  RunningStatistics running(wide_objectives());
  for (std::uint64_t run = 0; run < 3000; ++run) {
    results.push_back(scattered_result_of(run));
    if (run == 0) results[0].estimate.assign(num_parameters, 1e6);
    running.add(results.back());
  }
  const CampaignStatistics in_memory = test::statistics_of(wide_objectives(), results);
  for (std::size_t i = 0; i < num_parameters; ++i) {
    const AccuracyStatistic found = running.statistics().accuracy[i];
    const AccuracyStatistic& expected = in_memory.accuracy[i];
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
