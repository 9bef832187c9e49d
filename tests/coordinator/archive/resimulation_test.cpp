#include "coordinator/archive/resimulation.hpp"

#include <gmock/gmock.h>

#include <atomic>
#include <set>
#include <stdexcept>

#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

std::vector<RunIndex> chosen_runs(const std::vector<RunRange>& runs, double fraction) {
  ChosenRuns chosen(runs, fraction);
  std::vector<RunIndex> all;
  for (std::uint64_t i = 0; i < chosen.size(); ++i) all.push_back(chosen.next(i));
  return all;
}

std::vector<RunRange> first_runs(std::uint64_t count) { return {{RunIndex{0}, count}}; }

TEST(ChosenRuns, AreAsManyAsAskedFor) {
  EXPECT_EQ(chosen_runs(first_runs(1000), 0.01).size(), 10U);
  EXPECT_EQ(chosen_runs(first_runs(1000), 0.0101).size(), 11U);
  EXPECT_EQ(chosen_runs(first_runs(1000), 0.0).size(), 1U);
  EXPECT_EQ(chosen_runs(first_runs(3), 0.01).size(), 1U);
  EXPECT_THAT(chosen_runs({{{3}, 2}, {{9}, 1}, {{20}, 2}}, 1.0),
              ElementsAre(RunIndex{3}, RunIndex{4}, RunIndex{9}, RunIndex{20}, RunIndex{21}));
  EXPECT_THAT(chosen_runs({}, 1.0), IsEmpty());
}

TEST(ChosenRuns, AreSpreadEvenlyAndDifferent) {
  for (const std::size_t count : {std::size_t{1}, std::size_t{17}, std::size_t{999}}) {
    const std::vector<RunIndex> chosen = chosen_runs(first_runs(1000), double(count) / 1000.0);
    ASSERT_EQ(chosen.size(), count);
    for (std::size_t i = 0; i < count; ++i) {
      // One of each of `count` parts of equal length.
      EXPECT_GE(double(chosen[i].value), double(i) * 1000.0 / double(count) - 1.0);
      EXPECT_LT(double(chosen[i].value), double(i + 1) * 1000.0 / double(count));
    }
    EXPECT_EQ(std::set<RunIndex>(chosen.begin(), chosen.end()).size(), count);
  }
}

// The middle of each part, so that the last runs have the chance of the first.
TEST(ChosenRuns, AreInTheMiddleOfEachPart) {
  const std::vector<RunIndex> expected{{50}, {150}, {250}, {350}};
  EXPECT_EQ(chosen_runs(first_runs(400), 0.01), expected);
}

TEST(ResultDifferences, AreOfBitsThatMeanSomething) {
  const RunResult stored = test::result_of(3, RunStatus::not_finite);
  RunResult computed = stored;
  computed.estimate = {99.0};  // Without a meaning.
  EXPECT_THAT(differences_of(stored, computed), IsEmpty());
  computed.truth[0] = 0.5;
  computed.num_draws = 7;
  computed.num_rounds = 9;
  const std::vector<ResultDifference> differences = differences_of(stored, computed);
  ASSERT_EQ(differences.size(), 3U);
  EXPECT_EQ(differences[0].column, "num_draws");
  EXPECT_EQ(differences[1].column, "num_rounds");
  EXPECT_EQ(differences[1].stored, "3");
  EXPECT_EQ(differences[1].computed, "9");
  EXPECT_EQ(differences[2].run, RunIndex{3});
  EXPECT_EQ(differences[2].column, "truth_a_c11_delta_x_m");
  EXPECT_EQ(differences[2].stored, "1.3333333333333333");
  EXPECT_EQ(differences[2].computed, "0.5");
}

TEST(ResultDifferences, OfAnotherStatusAreThatAlone) {
  const RunResult stored = test::result_of(3);
  RunResult computed = test::result_of(3, RunStatus::no_draw);
  computed.num_draws = 1000;
  const std::vector<ResultDifference> differences = differences_of(stored, computed);
  ASSERT_EQ(differences.size(), 1U);
  EXPECT_EQ(differences[0].column, "status");
  EXPECT_EQ(differences[0].stored, "completed");
  EXPECT_EQ(differences[0].computed, "no_draw");
}

// More threads than batches, and a last batch that is not full.
TEST(Resimulation, FindsTheSameWithAnyNumberOfThreads) {
  const MicroscopeCampaign campaign = test::quick_campaign(35);
  std::vector<RunResult> results = test::simulated(campaign);
  for (const std::size_t run : {std::size_t{34}, std::size_t{2}}) results[run].truth[1] += 1.0;
  for (const std::size_t num_threads : {std::size_t{1}, std::size_t{2}, std::size_t{5}}) {
    const auto differences = simulate_again(campaign, results, num_threads, test::never_stopped);
    ASSERT_EQ(differences.size(), 2U);
    EXPECT_EQ(differences[0].run, RunIndex{2});
    EXPECT_EQ(differences[1].run, RunIndex{34});
  }
}

// The threads that end because another one failed do not hide its reason.
TEST(Resimulation, EndsWithTheFirstFailureOfAnyThread) {
  const MicroscopeCampaign campaign = test::quick_campaign(48);
  const std::vector<RunResult> results = test::simulated(campaign);
  for (const std::size_t num_threads : {std::size_t{1}, std::size_t{3}}) {
    std::atomic<int> num_questions = 0;
    const auto is_stopped = [&]() -> bool {
      if (++num_questions == 2) throw std::runtime_error("no clock");
      return false;
    };
    EXPECT_THAT([&] { (void)simulate_again(campaign, results, num_threads, is_stopped); },
                ThrowsMessage<std::runtime_error>("no clock"));
  }
}

// Values of a table are those of the run, not of its place among those that are simulated.
TEST(Resimulation, TakesTheTableValuesOfEachRun) {
  MicroscopeCampaign campaign = test::quick_campaign(4);
  campaign.dispersions[5] = {.law = Law::table, .file = "f.csv", .column = "a"};
  campaign.table_columns = {{1e-4, 2e-4, 3e-4, 4e-4}};
  const std::vector<RunResult> results = test::simulated(campaign);
  const std::vector<RunResult> last{results[3]};
  EXPECT_THAT(simulate_again(campaign, last, 1, test::never_stopped), IsEmpty());
}

}  // namespace
}  // namespace proofmass::coordinator
