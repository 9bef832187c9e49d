#include "coordinator/report/replicates.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <optional>
#include <vector>

#include "coordinator/table/terminal_table.hpp"
#include "tests/coordinator/report/review_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr SamplingDesign of_four{.kind = DesignKind::sobol, .points = 4};

/// A run whose errors are this many of their objectives.
RunResult run_off_by(std::uint64_t run, double parts) {
  RunResult result = test::result_of(run);
  result.num_draws = 1;
  const std::vector<double> objectives = test::campaign_of(1).objectives();
  for (std::size_t i = 0; i < objectives.size(); ++i) {
    result.truth[i] = 0.0;
    result.estimate[i] = parts * objectives[i];
  }
  return result;
}

/// Errors of 0, r, -2 r and 3 in replicate r, of which run 17 is not there.
std::optional<RunResult> run_number(std::uint64_t run) {
  if (run == 17) return std::nullopt;
  const auto replicate = static_cast<double>(run / 4);
  return run_off_by(run, std::vector{0.0, 0.1 * replicate, -0.2 * replicate, 3.0}[run % 4]);
}

ReplicateStatistics replicates_of(std::uint64_t num_runs) {
  RunningReplicates running(test::campaign_of(1).objectives(), of_four);
  for (std::uint64_t run = 0; run < num_runs; ++run) {
    if (const std::optional<RunResult> result = run_number(run)) running.add(*result);
  }
  return running.statistics();
}

// Replicates 0 to 8 without 4 have the means (3 - 0.1 r)/4 of the error, whose values of r have the
// mean 4 and the sum of squares 188 - 8·16 = 60 about it. Student's law with 7 degrees: 2.36462.
TEST(Replicates, MakeIntervalsOfTheirMeans) {
  const ReplicateStatistics statistics = replicates_of(36);
  EXPECT_EQ(statistics.num_replicates, 8U);
  EXPECT_THAT(statistics.incomplete, ElementsAre(4U));
  EXPECT_EQ(statistics.num_estimated, 32U);
  ASSERT_EQ(statistics.quantities.size(), 10U);
  const double objective = test::campaign_of(1).objectives().front();
  const ReplicatedQuantity& of = statistics.quantities.front();
  EXPECT_NEAR(of.bias.mean / objective, 0.65, 1e-12);
  ASSERT_TRUE(of.bias.interval);
  const double half_width = 2.364624251592785 * 0.025 * std::sqrt(60.0 / 7.0 / 8.0);
  EXPECT_NEAR(of.bias.interval->lower / objective, 0.65 - half_width, 1e-12);
  EXPECT_NEAR(of.bias.interval->upper / objective, 0.65 + half_width, 1e-12);
  EXPECT_NEAR(of.magnitude.mean / objective, (3.0 + 0.3 * 4.0) / 4.0, 1e-12);
  EXPECT_NEAR(of.beyond.mean, (8.0 + 3.0) / 32.0, 1e-12);
  EXPECT_FALSE(of.beyond.interval);  // Of 11 runs.
}

TEST(Replicates, LeaveOutTheOneThatIsNotFinishedYet) {
  const ReplicateStatistics statistics = replicates_of(35);
  EXPECT_EQ(statistics.num_replicates, 7U);
  EXPECT_THAT(statistics.incomplete, ElementsAre(4U, 8U));
  EXPECT_FALSE(statistics.quantities.front().bias.interval);
  EXPECT_THAT(terminal_text(replicate_table(test::schema(), statistics)),
              AllOf(HasSubstr("7 complete replicates of 4 runs (campaign.design = \"sobol\")"),
                    HasSubstr("left out, as a run has no result: replicate 4, 8"),
                    HasSubstr("an interval needs 8 replicates")));
  EXPECT_THAT(replicate_table(test::schema(), replicates_of(3)).rows, IsEmpty());
  EXPECT_THAT(replicate_table(test::schema(), replicates_of(0)).rows, IsEmpty());
}

// 40 replicates; the count of runs beyond is always 1, or alternates between 0 and 2.
TEST(Replicates, StateNoIntervalOfSharesThatHardlyDiffer) {
  for (const bool alternates : {false, true}) {
    RunningReplicates running(test::campaign_of(1).objectives(), of_four);
    for (std::uint64_t run = 0; run < 160; ++run) {
      const std::uint64_t num_beyond = alternates ? run / 4 % 2 * 2 : 1;
      running.add(run_off_by(run, run % 4 < num_beyond ? 2.0 : 0.5));
    }
    const ReplicateStatistics statistics = running.statistics();
    EXPECT_NEAR(statistics.within_objectives.mean, 0.75, 1e-12);
    EXPECT_EQ(statistics.within_objectives.interval.has_value(), alternates);
    EXPECT_EQ(statistics.quantities.front().beyond.interval.has_value(), alternates);
  }
}

TEST(Replicates, CountRunsWithoutAnEstimateAsMissesAlone) {
  RunningReplicates running(test::campaign_of(1).objectives(), of_four);
  for (std::uint64_t run = 0; run < 4; ++run) {
    RunResult result = run_off_by(run, 0.25 * static_cast<double>(run));
    if (run == 2) result.status = RunStatus::not_converged;
    running.add(result);
  }
  RunResult drawn_again = run_off_by(4, 0.0);
  drawn_again.num_draws = 2;
  running.add(drawn_again);
  for (std::uint64_t run = 5; run < 8; ++run) running.add(run_off_by(run, 0.0));
  const ReplicateStatistics statistics = running.statistics();
  EXPECT_EQ(statistics.num_estimated, 7U);
  EXPECT_EQ(statistics.num_drawn_again, 1U);
  EXPECT_NEAR(statistics.within_objectives.mean, 7.0 / 8.0, 1e-12);
  const double objective = test::campaign_of(1).objectives().front();
  EXPECT_NEAR(statistics.quantities.front().bias.mean / objective, 0.5 * (1.0 / 3.0), 1e-12);
}

}  // namespace
}  // namespace proofmass::coordinator
