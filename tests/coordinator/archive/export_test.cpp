#include "coordinator/archive/export.hpp"

#include "coordinator/archive/replay.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

class Export : public test::StoreTest {
 protected:
  Export()
      : store_(test::store_of(file(), test::campaign_of(5), test::results_of_each_status(5))) {}

  [[nodiscard]] std::filesystem::path output() const { return directory() / "output"; }

  Store store_;
};

TEST_F(Export, CanBeInterrupted) {
  EXPECT_THROW(export_hdf5(store_, output(), test::stopped_at_once), Interrupted);
  EXPECT_FALSE(file_names().contains("output"));
  EXPECT_THAT(file_names(), Each(Not(EndsWith(".new"))));
}

// Runs that a coordinator adds meanwhile would otherwise follow for ever.
TEST_F(Export, IsOfOneInstant) {
  Store store = test::store_of(directory() / "b.db", test::campaign_of(9), {});
  (void)store.commit(test::deliveries_of(0, 3));
  const Store reader = Store::open_read_only(directory() / "b.db");
  std::uint64_t num_runs = 0;
  walk_results(reader, test::never_stopped, [&](const RunResult&) {
    if (num_runs++ == 0) (void)store.commit(test::deliveries_of(3, 9));
  });
  EXPECT_EQ(num_runs, 3U);
}

// A campaign that grows while it is exported, run by run, is drawn as it was when the export began.
TEST_F(Export, OfDrawsIsOfTheStateThatTheRunsAreOf) {
  const auto exported = [&](const HeedStop& heed_stop) {
    export_hdf5(Store::open_read_only(file()), output(), heed_stop, DrawColumns::included);
    return test::content_of(output());
  };
  const std::string before = exported(test::never_stopped);
  const auto grow = [&, is_first = true]() mutable {
    if (!std::exchange(is_first, false)) return;
    store_.extend(test::campaign_of(6), canonical_definition(test::campaign_of(6)));
    (void)store_.commit(test::deliveries_of(5, 6));
  };
  EXPECT_TRUE(exported(grow) == before);
  EXPECT_FALSE(exported(test::never_stopped) == before);
}

class Listing : public test::StoreTest {
 protected:
  std::filesystem::path make(const std::string& name) const {
    const std::filesystem::path path = directory() / name;
    (void)Store::create(path, test::campaign_of(10), "");
    return path;
  }
  static std::string refusal(const std::filesystem::path& place) {
    const std::vector<std::filesystem::path> places{place};
    return test::error_of([&] { (void)list_campaigns(places); });
  }
};

TEST_F(Listing, SaysWhichDirectoryItCannotRead) {
  const auto closed = directory() / "closed";
  std::filesystem::create_directory(closed);
  std::filesystem::permissions(directory(), std::filesystem::perms::all);
  std::filesystem::permissions(closed, std::filesystem::perms::none);
  std::string error;
  {
    const test::OrdinaryUser user;
    error = refusal(closed);
  }
  std::filesystem::permissions(closed, std::filesystem::perms::all);
  EXPECT_EQ(error, "directory = " + closed.string() + " (cannot be read: Permission denied)");
}

TEST_F(Listing, NamesAFileThatItMayNotRead) {
  const auto closed = make("closed.db");
  std::filesystem::permissions(directory(), std::filesystem::perms::all);
  std::filesystem::permissions(closed, std::filesystem::perms::none);
  const test::OrdinaryUser user;
  for (const auto& place : {directory(), closed}) {
    const auto campaigns = list_campaigns({&place, 1});
    ASSERT_EQ(campaigns.size(), 1U);
    EXPECT_EQ(campaigns[0].problem, "campaign database = " + closed.string() +
                                        " (unable to open database file: Permission denied)");
  }
}

using ::testing::ThrowsMessage;

std::vector<RunRange> first_runs(std::uint64_t count) { return {{RunIndex{0}, count}}; }

TEST(ChosenRuns, AreAsManyAsAskedFor) {
  EXPECT_EQ(chosen_runs(first_runs(1000), 0.01).size(), 10U);
  EXPECT_EQ(chosen_runs(first_runs(1000), 0.0101).size(), 11U);
  EXPECT_EQ(chosen_runs(first_runs(1000), 0.0).size(), 1U);
  EXPECT_EQ(chosen_runs(first_runs(3), 0.01).size(), 1U);
  EXPECT_THAT(chosen_runs(std::vector<RunRange>{{{3}, 2}, {{9}, 1}, {{20}, 2}}, 1.0),
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

TEST(ResultDifferences, OfAnotherStatusAreThatAlone) {
  const RunResult stored = test::result_of(3);
  RunResult computed = test::result_of(3, RunStatus::no_draw);
  computed.num_draws = 1000;
  const std::vector<ResultDifference> differences =
      differences_of(stored, computed, test::schema());
  ASSERT_EQ(differences.size(), 1U);
  EXPECT_EQ(differences[0].column, "status");
  EXPECT_EQ(differences[0].stored, "completed");
  EXPECT_EQ(differences[0].computed, "no_draw");
}

// The threads that end because another one failed do not hide its reason.
TEST(Resimulation, EndsWithTheFirstFailureOfAnyThread) {
  const MicroscopeCampaign campaign = test::quick_campaign(48);
  const std::vector<RunResult> results = test::simulated(campaign);
  for (const std::size_t num_threads : {std::size_t{1}, std::size_t{3}}) {
    std::atomic<int> num_questions = 0;
    const auto heed_stop = [&] {
      if (++num_questions == 2) throw std::runtime_error("no clock");
    };
    EXPECT_THAT([&] { (void)simulate_again(campaign, results, num_threads, heed_stop); },
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
