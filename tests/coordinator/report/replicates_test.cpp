#include "coordinator/report/read_results.hpp"
#include "coordinator/table/table.hpp"
#include "tests/coordinator/report/review_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

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
  RunningReplicates running(test::schema(), test::campaign_of(1).objectives(), of_four);
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
  EXPECT_NEAR(of.beyond->mean, (8.0 + 3.0) / 32.0, 1e-12);
  EXPECT_FALSE(of.beyond->interval);  // Of 11 runs.
}

TEST(Replicates, AreBeyondNoObjectiveThatTheyHaveNot) {
  const std::vector<double> none(10, std::numeric_limits<double>::infinity());
  RunningReplicates running(test::schema(), none, of_four);
  for (std::uint64_t run = 0; run < 4; ++run) running.add(*run_number(run));
  const ReplicateStatistics statistics = running.statistics();
  EXPECT_FALSE(statistics.quantities.front().beyond);
  EXPECT_THAT(terminal_text(replicate_table(test::schema(), statistics), {}),
              Not(HasSubstr("all objectives")));
}

// One of 20 means that is apart: their skewness is √20, of which √20/5 + 2√(6/20) = 2.0 may be
// chance. Of two that are, one on each side, it is 0.
TEST(Replicates, SayWhereTheyAreTooSkewedForIntervals) {
  for (const double of_second : {0.0, -1.0}) {
    RunningReplicates running(test::schema(), test::campaign_of(1).objectives(), of_four);
    for (std::uint64_t run = 0; run < 80; ++run) {
      running.add(run_off_by(run, run == 8 ? 1.0 : run == 12 ? of_second : 0.0));
    }
    const ReplicateStatistics statistics = running.statistics();
    EXPECT_EQ(statistics.quantities.front().bias.is_too_skewed, of_second == 0.0);
    EXPECT_THAT(replicate_table(test::schema(), statistics).notes,
                Contains(HasSubstr("too skewed for intervals from 20 replicates")));  // |error| is.
  }
}

TEST(Replicates, LeaveOutTheOneThatIsNotFinishedYet) {
  const ReplicateStatistics statistics = replicates_of(35);
  EXPECT_EQ(statistics.num_replicates, 7U);
  EXPECT_THAT(statistics.incomplete, ElementsAre(4U, 8U));
  EXPECT_FALSE(statistics.quantities.front().bias.interval);
  EXPECT_THAT(terminal_text(replicate_table(test::schema(), statistics)),
              AllOf(HasSubstr("7 complete replicates of 4 runs (campaign.design = \"sobol\")"),
                    HasSubstr("left out, as a run is not finished yet: replicate 4, 8"),
                    HasSubstr("an interval needs 8 replicates")));
  EXPECT_THAT(replicate_table(test::schema(), replicates_of(3)).rows, IsEmpty());
  EXPECT_THAT(replicate_table(test::schema(), replicates_of(0)).rows, IsEmpty());
}

// 40 replicates; the count of runs beyond is always 1, or alternates between 0 and 2.
TEST(Replicates, StateNoIntervalOfSharesThatHardlyDiffer) {
  for (const bool alternates : {false, true}) {
    RunningReplicates running(test::schema(), test::campaign_of(1).objectives(), of_four);
    for (std::uint64_t run = 0; run < 160; ++run) {
      const std::uint64_t num_beyond = alternates ? run / 4 % 2 * 2 : 1;
      running.add(run_off_by(run, run % 4 < num_beyond ? 2.0 : 0.5));
    }
    const ReplicateStatistics statistics = running.statistics();
    EXPECT_NEAR(statistics.within_objectives.mean, 0.75, 1e-12);
    EXPECT_EQ(statistics.within_objectives.interval.has_value(), alternates);
    EXPECT_EQ(statistics.quantities.front().beyond->interval.has_value(), alternates);
  }
}

TEST(Replicates, CountRunsWithoutAnEstimateAsBeyondEveryObjective) {
  RunningReplicates running(test::schema(), test::campaign_of(1).objectives(), of_four);
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
  EXPECT_NEAR(statistics.quantities.front().beyond->mean, 1.0 / 8.0, 1e-12);
  EXPECT_FALSE(statistics.quantities.front().covered);
  EXPECT_THAT(terminal_text(replicate_table(test::schema(), statistics)),
              HasSubstr("1 run without an estimate is left out of the means of its replicate\n"));
  const double objective = test::campaign_of(1).objectives().front();
  EXPECT_NEAR(statistics.quantities.front().bias.mean / objective, 0.5 * (1.0 / 3.0), 1e-12);
}

/// In replicate r the standard errors cover 4 − r mod 3 of the errors.
RunResult covered_in_part(std::uint64_t run) {
  return test::result_off_by(run, run % 4 < run / 4 % 3 ? -3.0 : 1.0);
}

// 40 replicates: 14 shares of 1, 13 of ¾ and 13 of ½. Student's law with 39 degrees: 2.02269.
TEST(Replicates, MakeTheIntervalOfWhatStandardErrorsCover) {
  RunningReplicates running(test::schema(), test::campaign_of(1).objectives(), of_four);
  for (std::uint64_t run = 0; run < 160; ++run) {
    running.add(covered_in_part(run));
  }
  const ReplicateStatistics statistics = running.statistics();
  const double mean = (14.0 + 13.0 * 0.75 + 13.0 * 0.5) / 40.0;
  const double squares = 14.0 * (1.0 - mean) * (1.0 - mean) + 13.0 * (0.75 - mean) * (0.75 - mean) +
                         13.0 * (0.5 - mean) * (0.5 - mean);
  const double half_width = 2.022690920036708 * std::sqrt(squares / 39.0 / 40.0);
  for (const ReplicatedQuantity& of : statistics.quantities) {
    ASSERT_TRUE(of.covered && of.covered->interval);
    EXPECT_NEAR(of.covered->mean, mean, 1e-12);
    EXPECT_NEAR(of.covered->interval->lower, mean - half_width, 1e-9);
    EXPECT_NEAR(of.covered->interval->upper, mean + half_width, 1e-9);
  }
}

using ReadGroups = test::StoreTest;

/// Reads results of the campaign in which runs 1, 6 and 7 of 8 were given up, and the others are
/// off by a tenth of their objectives.
ReadResults with_given_up(const std::filesystem::path& file, const MicroscopeCampaign& campaign) {
  Store store = Store::create(file, campaign, canonical_definition(campaign));
  std::vector<Entry> entries{test::worker_1()};
  for (const std::uint64_t run : {0U, 2U, 3U, 4U, 5U}) {
    Delivery delivery = test::delivery_of(run);
    delivery.result = test::result_off_by(run, 1.0);
    entries.emplace_back(delivery);
  }
  for (const std::uint64_t run : {1U, 6U, 7U}) entries.emplace_back(GivenUpRun{.run = {run}});
  store.write(entries);
  return read_results(store, campaign);
}

TEST_F(ReadGroups, CountARunOfAReplicateThatWasGivenUpAsLost) {
  MicroscopeCampaign campaign = test::campaign_of(8);
  campaign.design = of_four;
  const ReplicateStatistics statistics = *with_given_up(file(), campaign).replicates;
  EXPECT_EQ(statistics.num_replicates, 2U);
  EXPECT_EQ(statistics.num_incomplete, 0U);
  EXPECT_EQ(statistics.num_estimated, 5U);
  EXPECT_NEAR(statistics.within_objectives.mean, 5.0 / 8.0, 1e-12);
  EXPECT_NEAR(statistics.quantities.front().beyond->mean, 3.0 / 8.0, 1e-12);
}

TEST_F(ReadGroups, GiveTheTableOfStandardErrorsItsInterval) {
  MicroscopeCampaign campaign = test::campaign_of(160);
  campaign.design = of_four;
  Store store = Store::create(file(), campaign, canonical_definition(campaign));
  std::vector<Entry> entries{test::worker_1()};
  for (std::uint64_t run = 0; run < 160; ++run) {
    Delivery delivery = test::delivery_of(run);
    delivery.result = covered_in_part(run);
    entries.emplace_back(delivery);
  }
  store.write(entries);
  const ReadResults results = read_results(store, campaign);
  const StandardErrorStatistic& of = results.standard_errors.quantities.front();
  const auto& covered = results.replicates->quantities.front().covered;
  EXPECT_FALSE(of.squared_ratio_error);
  ASSERT_TRUE(of.within);
  EXPECT_EQ(of.within->lower, covered->interval->lower);
  EXPECT_EQ(of.within->upper, covered->interval->upper);
  EXPECT_THAT(terminal_text(standard_error_table(test::schema(), results.standard_errors)),
              AllOf(HasSubstr("from, to: 95 % interval from replicates\n"), Not(HasSubstr("±"))));
}

TEST_F(ReadGroups, CountARunOfAnInstrumentThatWasGivenUpAsLost) {
  MicroscopeCampaign campaign = test::campaign_of(8);
  campaign.realisations = 2;
  const InstrumentStatistics statistics = *with_given_up(file(), campaign).instruments;
  EXPECT_EQ(statistics.num_instruments, 4U);
  EXPECT_EQ(statistics.num_incomplete, 0U);
  EXPECT_EQ(statistics.num_not_estimated, 2U);
  EXPECT_DOUBLE_EQ(statistics.mixed.share, 5.0 / 8.0);
}

}  // namespace
}  // namespace proofmass::coordinator
