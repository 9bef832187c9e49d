#include "coordinator/report/error_figures.hpp"

#include <gmock/gmock.h>

#include <cmath>
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

TEST(FigurePasses, HaveTheMomentsOfTheFirstRuns) {
  FigurePasses passes(1, 300);
  std::vector<double> magnitudes;
  for (std::uint64_t run = 0; run < 300; ++run) {
    passes.add(run_with(run, error_at(run)));
    magnitudes.push_back(std::abs((2.0 + error_at(run)) - 2.0));
  }
  EXPECT_FALSE(passes.end_pass());
  const std::vector<QuantityFigures> figures = passes.figures();
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

TEST(FigurePasses, NameTheFiveWorstRuns) {
  FigurePasses passes(1, 8);
  const std::vector<double> errors{0.25, -0.5, 0.125, 0.5, -1.0, 0.0, 0.75, 0.0625};
  for (std::uint64_t run = 0; run < errors.size(); ++run) passes.add(run_with(run, errors[run]));
  EXPECT_FALSE(passes.end_pass());
  const std::vector<QuantityFigures> figures = passes.figures();
  std::vector<std::uint64_t> runs;
  for (const RunError& worst : figures[0].worst) runs.push_back(worst.run.value);
  EXPECT_THAT(runs, ElementsAre(4, 6, 1, 3, 0));  // Of the equal ones 1 and 3 the first.
}

TEST(FigurePasses, LeaveOutRunsWithoutAnEstimate) {
  FigurePasses passes(1, 10);
  for (std::uint64_t run = 0; run < 10; ++run) {
    RunResult result = run_with(run, 0.5);
    if (run >= 7) result = {.run = {run}, .status = RunStatus::not_finite, .truth = {2.0}};
    passes.add(result);
  }
  EXPECT_FALSE(passes.end_pass());
  EXPECT_EQ(passes.figures()[0].convergence.back().num_runs, 7U);
}

}  // namespace
}  // namespace proofmass::coordinator
