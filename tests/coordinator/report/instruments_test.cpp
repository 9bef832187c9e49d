#include "coordinator/report/read_results.hpp"
#include "coordinator/table/table.hpp"
#include "proto/text/visible_text.hpp"
#include "tests/coordinator/report/review_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

const std::vector<double>& objectives() {
  static const std::vector<double> all = test::campaign_of(1).objectives();
  return all;
}

/// Instruments of two runs: one with both, two with a lost one, and one that is not finished.
InstrumentStatistics with_missing_runs() {
  RunningInstruments running(test::schema(), objectives(), 2);
  running.add(test::result_off_by(0, -1.0));
  running.add(test::result_off_by(1, 1.0));
  running.add(test::result_off_by(2, 0.5));
  running.add(test::result_of(3, RunStatus::lost));
  running.add(test::result_of(4, RunStatus::lost));
  running.add(test::result_off_by(5, 0.5));
  running.add(test::result_off_by(6, 0.5));
  return running.statistics();
}

TEST(Instruments, CountARunWithoutAnEstimateAsBeyondAndSayNothingOfItsStandardErrors) {
  const InstrumentStatistics statistics = with_missing_runs();
  EXPECT_EQ(statistics.num_instruments, 3U);
  EXPECT_EQ(statistics.num_incomplete, 1U);
  EXPECT_EQ(statistics.num_not_estimated, 2U);
  EXPECT_DOUBLE_EQ(statistics.mixed.share, 4.0 / 6.0);
  EXPECT_DOUBLE_EQ(statistics.ensemble.share, 1.0 / 3.0);
  EXPECT_EQ(statistics.temporal, 1U);
  EXPECT_EQ(statistics.num_temporal, 2U);
  EXPECT_EQ(statistics.temporal_instrument, 1U);
  ASSERT_EQ(statistics.quantities.size(), objectives().size());
  for (const InstrumentQuantity& of : statistics.quantities) {
    EXPECT_DOUBLE_EQ(of.beyond->share, 2.0 / 6.0);
    EXPECT_DOUBLE_EQ(of.standard_errors->covered.share, 1.0);
    EXPECT_DOUBLE_EQ(of.standard_errors->covered_within.share, 1.0);
  }
}

TEST(Instruments, AreBeyondNoObjectiveThatTheyHaveNot) {
  const std::vector<double> none(objectives().size(), std::numeric_limits<double>::infinity());
  RunningInstruments running(test::schema(), none, 2);
  running.add(test::result_off_by(0, -1.0));
  running.add(test::result_off_by(1, 1.0));
  const InstrumentStatistics statistics = running.statistics();
  EXPECT_FALSE(statistics.quantities.front().beyond);
  EXPECT_THAT(terminal_text(instrument_table(test::schema(), statistics), {}),
              Not(HasSubstr("all objectives")));
}

// Errors of ±0.1 objectives have the variance 2·0.1², which is twice the squared standard error.
TEST(Instruments, LeaveAnInstrumentWithARunWithoutAnEstimateOutOfVariances) {
  const InstrumentStatistics statistics = with_missing_runs();
  for (std::size_t i = 0; i < objectives().size(); ++i) {
    const InstrumentQuantity& of = statistics.quantities[i];
    EXPECT_EQ(of.error.num_groups, 1U);
    EXPECT_NEAR(of.mean_magnitude / objectives()[i], 0.1, 1e-12);
    EXPECT_FALSE(of.magnitude_interval);
    EXPECT_NEAR(of.standard_errors->within_ratio.value(), 2.0, 1e-12);
  }
  const std::string text = terminal_text(variance_table(test::schema(), statistics), {});
  EXPECT_THAT(text, HasSubstr("3 instruments with 2 realisations of the noise each; 1 more"));
  EXPECT_THAT(text, HasSubstr("left out: 2 instruments with a run that has no estimate\n"));
  EXPECT_THAT(text, HasSubstr("noise: there is no interval from fewer than 10 instruments\n"));
}

TEST(Instruments, SayThatNoneIsComplete) {
  RunningInstruments running(test::schema(), objectives(), 3);
  running.add(test::result_off_by(0, 1.0));
  const InstrumentStatistics statistics = running.statistics();
  EXPECT_THAT(terminal_text(variance_table(test::schema(), statistics), {}),
              HasSubstr("none of which all 3 realisations are finished\n"));
  EXPECT_TRUE(instrument_table(test::schema(), statistics).rows.empty());
}

TEST(Instruments, SayHowOftenTheWorstOnesMeetAllObjectives) {
  const auto text_of = [](const std::vector<double>& pulls) {
    RunningInstruments running(test::schema(), objectives(), 2);
    for (std::size_t run = 0; run < pulls.size(); ++run) {
      running.add(test::result_off_by(run, pulls[run]));
    }
    return terminal_text(instrument_table(test::schema(), running.statistics()), {});
  };
  constexpr double beyond = 11.0;
  EXPECT_THAT(text_of({0.0, 0.0, 1.0, 1.0}),
              HasSubstr("(temporal): every instrument meets them in 2 of 2 realisations\n"));
  EXPECT_THAT(text_of({0.0, 0.0, 1.0, beyond}),
              HasSubstr("(temporal): the worst instrument, 1, meets them in 1 of 2\n"));
  EXPECT_THAT(text_of({0.0, 0.0, 1.0, beyond, beyond, 1.0}),
              HasSubstr("(temporal): each of the worst 2 instruments meets them in 1 of 2\n"));
}

// As replicates: the skewness of one of 20 that is apart is √20.
TEST(Instruments, SayWhereTheyAreTooSkewedForIntervals) {
  for (const std::uint64_t num_apart : {1U, 10U}) {
    RunningInstruments running(test::schema(), objectives(), 2);
    for (std::uint64_t run = 0; run < 40; ++run) {
      running.add(test::result_off_by(run, run / 2 < num_apart ? 1.0 : 0.0));
    }
    const InstrumentStatistics statistics = running.statistics();
    EXPECT_EQ(statistics.quantities.front().is_too_skewed, num_apart == 1);
    const std::string notes =
        fmt::format("{}", fmt::join(variance_table(test::schema(), statistics).notes, "\n"));
    EXPECT_EQ(notes.find("too skewed for intervals from 20 instruments") != std::string::npos,
              num_apart == 1);
  }
}

TEST(Instruments, HaveTablesThatFitATerminal) {
  RunningInstruments running(test::schema(), objectives(), 2);
  for (std::uint64_t run = 0; run < 40; ++run) {
    const auto instrument = static_cast<double>(run / 2 % 7);
    running.add(
        test::result_off_by(run, 3.0 * instrument - 12.0 + std::cos(static_cast<double>(run))));
  }
  const InstrumentStatistics statistics = running.statistics();
  EXPECT_TRUE(statistics.quantities.front().error.within_share_interval);
  std::istringstream lines(terminal_text(variance_table(test::schema(), statistics), {}) +
                           terminal_text(instrument_table(test::schema(), statistics), {}));
  for (std::string line; std::getline(lines, line);) EXPECT_LE(display_width(line), 80U) << line;
}

}  // namespace
}  // namespace proofmass::coordinator
