#include "coordinator/report/error_figures.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include "core/statistics/moments.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::ElementsAre;

/// A run with one quantity, whose error is this.
RunResult run_with(std::uint64_t run, double error) {
  return {.run = {run}, .truth = {2.0}, .estimate = {2.0 + error}};
}

double error_at(std::uint64_t run) { return std::ldexp(std::sin(static_cast<double>(run)), -3); }

TEST(ConvergenceCounts, AscendFromFiveToAllRuns) {
  EXPECT_TRUE(convergence_counts(0).empty());
  EXPECT_THAT(convergence_counts(3), ElementsAre(3));
  EXPECT_THAT(convergence_counts(7), ElementsAre(5, 6, 7));
  const std::vector<std::uint64_t> counts = convergence_counts(1'000'000);
  EXPECT_EQ(counts.size(), 41U);
  EXPECT_EQ(counts.front(), 5U);
  EXPECT_EQ(counts.back(), 1'000'000U);
  // Equal steps of a logarithmic axis: each number is 200,000^(1/40) = 1.357 times the one before.
  EXPECT_NEAR(static_cast<double>(counts[30]) / static_cast<double>(counts[29]), 1.357, 0.001);
}

TEST(ErrorFigures, HaveTheMomentsOfTheFirstRuns) {
  ErrorFigures collected(1, 300);
  std::vector<double> magnitudes;
  for (std::uint64_t run = 0; run < 300; ++run) {
    collected.add(run_with(run, error_at(run)));
    magnitudes.push_back(std::abs((2.0 + error_at(run)) - 2.0));
  }
  const std::vector<QuantityFigures> figures = collected.figures();
  ASSERT_EQ(figures.size(), 1U);
  ASSERT_EQ(figures[0].convergence.back().num_runs, 300U);
  for (const ConvergencePoint& point : figures[0].convergence) {
    const std::span<const double> first = std::span(magnitudes).first(point.num_runs);
    const Moments expected = moments(first);
    EXPECT_NEAR(point.mean, expected.mean, 1e-13 * expected.mean);
    EXPECT_NEAR(point.standard_deviation, expected.standard_deviation,
                1e-12 * expected.standard_deviation);
    EXPECT_EQ(point.worst, *std::ranges::max_element(first));
    EXPECT_NEAR(point.deviation_interval->upper, deviation_interval(expected, 0.95)->upper,
                1e-9 * point.standard_deviation);
  }
}

TEST(ErrorFigures, NameTheFiveWorstRuns) {
  ErrorFigures collected(1, 8);
  const std::vector<double> errors{0.25, -0.5, 0.125, 0.5, -1.0, 0.0, 0.75, 0.0625};
  for (std::uint64_t run = 0; run < errors.size(); ++run) collected.add(run_with(run, errors[run]));
  const std::vector<QuantityFigures> figures = collected.figures();
  std::vector<std::uint64_t> runs;
  for (const RunValue& worst : figures[0].worst) runs.push_back(worst.run.value);
  EXPECT_THAT(runs, ElementsAre(4, 6, 1, 3, 0));  // Of the equal ones 1 and 3 the first.
}

TEST(ErrorFigures, LeaveOutRunsWithoutAnEstimate) {
  ErrorFigures collected(1, 10);
  for (std::uint64_t run = 0; run < 10; ++run) {
    RunResult result = run_with(run, 0.5);
    if (run >= 7) result = {.run = {run}, .status = RunStatus::not_finite, .truth = {2.0}};
    collected.add(result);
  }
  EXPECT_EQ(collected.figures()[0].convergence.back().num_runs, 7U);
}

std::uint64_t sum_of(const std::vector<std::uint64_t>& counts) {
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

/// How many values are in [lower, upper), counted one by one.
std::uint64_t count_between(const std::vector<double>& values, double lower, double upper) {
  return static_cast<std::uint64_t>(
      std::ranges::count_if(values, [&](double value) { return value >= lower && value < upper; }));
}

std::vector<double> normal_values(std::size_t count, double sigma) {
  std::mt19937_64 bits(7);
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i) {
    double sum = -6.0;  // Of twelve uniform ones: nearly normal, the same on every machine.
    for (int term = 0; term < 12; ++term) sum += static_cast<double>(bits() >> 11) * 0x1p-53;
    values.push_back(sigma * sum);
  }
  return values;
}

TEST(ErrorBins, CountEachValueBetweenItsEdges) {
  const std::vector<double> values = normal_values(5000, 3e-4);
  ErrorBins bins;
  for (const double value : values) bins.add(value);
  const Histogram histogram = bins.histogram();
  ASSERT_EQ(histogram.edges.size(), histogram.counts.size() + 1);
  EXPECT_LE(histogram.counts.size(), 64U);
  EXPECT_GE(histogram.counts.size(), 20U);
  for (std::size_t i = 0; i < histogram.counts.size(); ++i) {
    EXPECT_EQ(histogram.counts[i],
              count_between(values, histogram.edges[i], histogram.edges[i + 1]));
  }
  EXPECT_EQ(sum_of(histogram.counts), values.size());
}

TEST(ErrorBins, DoNotDependOnTheOrder) {
  std::vector<double> values = normal_values(1000, 1.0);
  ErrorBins forwards, backwards;
  for (const double value : values) forwards.add(value);
  std::ranges::reverse(values);
  for (const double value : values) backwards.add(value);
  EXPECT_EQ(forwards.histogram().edges, backwards.histogram().edges);
  EXPECT_EQ(forwards.histogram().counts, backwards.histogram().counts);
}

TEST(ErrorBins, HoldZerosAndTheLargestValues) {
  ErrorBins bins;
  EXPECT_TRUE(bins.histogram().counts.empty());
  bins.add(0.0);
  bins.add(-1e90);
  bins.add(1e90);
  EXPECT_EQ(sum_of(bins.histogram().counts), 3U);
}

// Ten bins a power of ten: 1, 2 and 5 are in the bins from 10^0, 10^0.3 and 10^0.6 on.
TEST(MagnitudeBins, AreTenAPowerOfTen) {
  MagnitudeBins bins;
  for (const double value : {1.0001, 2.1, 5.1, 5.2}) bins.add(value);
  const Histogram histogram = bins.histogram();
  EXPECT_THAT(histogram.counts, ElementsAre(1, 0, 0, 1, 0, 0, 0, 2));
  EXPECT_NEAR(histogram.edges.front(), 1.0, 1e-12);
  EXPECT_NEAR(histogram.edges.back(), std::pow(10.0, 0.8), 1e-9);
}

TEST(MagnitudeBins, LeaveOutOnePercentAtMost) {
  MagnitudeBins bins;
  bins.add(0.0);
  for (int i = 0; i < 199; ++i) bins.add(1.5);
  const Histogram histogram = bins.histogram();
  EXPECT_EQ(histogram.num_below, 1U);
  EXPECT_THAT(histogram.counts, ElementsAre(199));
}

TEST(MagnitudeBins, ShowTenPercent) {
  MagnitudeBins bins;
  for (int i = 0; i < 90; ++i) bins.add(1.5);
  for (int i = 0; i < 10; ++i) bins.add(0.75);
  EXPECT_THAT(bins.histogram().counts, ElementsAre(10, 0, 0, 90));
}

}  // namespace
}  // namespace proofmass::coordinator
