#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "core/campaign/statistics.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/statistics_in_memory.hpp"

namespace proofmass {
namespace {

/// Run `run` of a campaign whose errors have a long tail, and of which some have no estimate.
RunResult result_of(std::uint64_t run) {
  RunResult result = test::zero_result({.run = RunIndex{3 * run}, .num_draws = 1, .num_rounds = 1});
  if (run % 11 == 5) result.status = RunStatus::not_finite;
  if (run % 13 == 6) result.status = RunStatus::no_draw;
  if (run % 7 == 2) result.status = RunStatus::not_converged;
  const double phase = static_cast<double>(run) * 0.6180339887498949;
  const double uniform = phase - std::floor(phase);
  for (std::size_t i = 0; i < num_parameters; ++i) {
    result.truth[i] = static_cast<double>(i);
    const double error = 1e-3 * std::tan(3.1 * (uniform - 0.5)) * static_cast<double>(i + 1);
    result.estimate[i] = result.truth[i] + error;
  }
  return result;
}

std::vector<double> objectives() {
  std::vector<double> objectives;
  objectives.assign(num_parameters, 2e-3);
  return objectives;
}

CampaignStatistics in_passes(std::uint64_t num_runs, std::size_t num_kept) {
  StatisticsPasses passes(objectives(), num_kept);
  do {
    for (std::uint64_t run = 0; run < num_runs; ++run) passes.add(result_of(run));
  } while (passes.end_pass());
  return passes.statistics();
}

CampaignStatistics in_memory(std::uint64_t num_runs) {
  test::StatisticsInMemory results(objectives());
  for (std::uint64_t run = 0; run < num_runs; ++run) results.add(result_of(run));
  return results.statistics();
}

/// All numbers of a parameter as bits.
std::vector<std::uint64_t> bits_of(const AccuracyStatistic& accuracy) {
  std::vector<std::uint64_t> bits{accuracy.worst_run.value, accuracy.num_beyond_objective};
  const auto put = [&](double value) { bits.push_back(std::bit_cast<std::uint64_t>(value)); };
  const auto put_interval = [&](const std::optional<Interval>& interval) {
    bits.push_back(interval.has_value());
    put(interval ? interval->lower : 0.0);
    put(interval ? interval->upper : 0.0);
  };
  for (const double value :
       {accuracy.worst, accuracy.mean, accuracy.standard_deviation, accuracy.error.bias,
        accuracy.error.rms, accuracy.error.standard_deviation, accuracy.error.skewness}) {
    put(value);
  }
  put_interval(accuracy.beyond_objective);
  put_interval(accuracy.mean_interval);
  put_interval(accuracy.deviation_interval);
  put_interval(accuracy.error.bias_interval);
  put_interval(accuracy.error.deviation_interval);
  for (const PercentileStatistic& percentile : accuracy.percentiles) {
    put(percentile.level);
    put(percentile.value);
    put_interval(percentile.interval);
  }
  return bits;
}

TEST(StatisticsPasses, YieldTheBitsOfResultsInMemory) {
  for (const std::uint64_t num_runs : {0U, 1U, 2U, 3U, 6U, 40U, 500U, 3000U}) {
    const CampaignStatistics expected = in_memory(num_runs);
    for (const std::size_t num_kept : {std::size_t{0}, std::size_t{100}, num_passed_values_kept}) {
      const CampaignStatistics found = in_passes(num_runs, num_kept);
      EXPECT_EQ(found.num_runs, expected.num_runs);
      EXPECT_EQ(found.num_estimated, expected.num_estimated);
      EXPECT_EQ(found.num_not_converged, expected.num_not_converged);
      EXPECT_EQ(found.num_not_finite, expected.num_not_finite);
      EXPECT_EQ(found.num_no_draw, expected.num_no_draw);
      EXPECT_EQ(found.num_within_objectives, expected.num_within_objectives);
      for (std::size_t i = 0; i < num_parameters; ++i) {
        EXPECT_EQ(bits_of(found.accuracy[i]), bits_of(expected.accuracy[i])) << num_runs;
      }
    }
  }
}

TEST(StatisticsPasses, NeedOnePassForFewRuns) {
  StatisticsPasses passes(objectives());
  for (std::uint64_t run = 0; run < 1000; ++run) passes.add(result_of(run));
  EXPECT_FALSE(passes.end_pass());
}

TEST(StatisticsPassesDeathTest, RefuseRunsOutOfOrder) {
  StatisticsPasses passes(objectives());
  passes.add(result_of(5));
  EXPECT_DEATH(passes.add(result_of(5)), "internal invariant broken");
}

/// The largest size that the process ever had, bytes.
std::uint64_t largest_size() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    std::uint64_t kilobytes = 0;
    if (word == "VmHWM:" && status >> kilobytes) return kilobytes << 10;
  }
  return 0;
}

// Results of 1.5 million runs in memory take 132 MB, and as much again for their magnitudes; here
// the second half of them must not need more than the first.
TEST(StatisticsPasses, NeedNoMemoryThatGrowsWithTheRuns) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer keeps what is freed";
#endif
  const std::uint64_t before = largest_size();
  (void)in_passes(750'000, num_passed_values_kept);
  const std::uint64_t of_half = largest_size();
  (void)in_passes(1'500'000, num_passed_values_kept);
  const std::uint64_t of_all = largest_size();
  EXPECT_LT(of_half - before, std::uint64_t{140} << 20);
  EXPECT_LT(of_all - of_half, std::uint64_t{40} << 20);
}

}  // namespace
}  // namespace proofmass
