#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/campaign/budget.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

// What Store::write_statistics() shows through the views that people query.

using detail::Access;
using detail::Database;
using detail::Statement;

using StoreStatistics = test::StoreTest;

TEST_F(StoreStatistics, ComeWithASummary) {
  Store store = create(9);
  EXPECT_EQ(store.summary(), std::nullopt);
  store.write(std::vector<Entry>{GivenUpRun{.run = RunIndex{8}}});
  CampaignStatistics statistics{.num_runs = 9, .num_estimated = 7, .accuracy = {}};
  statistics.accuracy.resize(num_parameters);
  statistics.num_not_converged = 3;
  statistics.num_not_finite = 1;
  statistics.num_no_draw = 2;
  statistics.num_lost = 4;
  statistics.num_within_objectives = 5;
  const ErrorBudget budget = microscope_budget(Scenario{});
  const ResultDigests digest{.results = std::string(64, '5'), .health = std::string(64, '6')};
  store.write_statistics(statistics, budget, {.results = std::string(64, 'a'), .health = ""});
  store.write_statistics(statistics, budget, digest);
  const std::optional<Summary> summary = Store::open_read_only(file()).summary();
  ASSERT_TRUE(summary);
  EXPECT_EQ(*summary,
            (Summary{.num_finished = 9, .num_counted = 17, .num_given_up = 1, .digests = digest}));
  EXPECT_THAT(text("SELECT computed_utc FROM summary"),
              ::testing::MatchesRegex("20[0-9-]+T[0-9:]+Z"));
  EXPECT_THAT(store.statistic_differences(statistics, budget, {}, summary), IsEmpty());
  statistics.num_lost = 5;
  EXPECT_THAT(store.statistic_differences(statistics, budget, {}, summary),
              ElementsAre("summary.num_lost = 4 (must be 5)"));
}

// SQL adds up in another order than the budget. Runs have a residue of their own, or none.
TEST_F(StoreStatistics, ComeWithTheBudgetOfEachRun) {
  const MicroscopeCampaign campaign = campaign_of(6);
  Store store = Store::create(file(), campaign, "");
  std::vector<Delivery> deliveries = test::deliveries_of(0, 6);
  deliveries[2].result = test::result_of(2, RunStatus::no_draw);
  deliveries[3].result.health = test::values_of({.residual_m_s2 = 3.5e-11});
  deliveries[4].result.health = test::values_of({.residual_m_s2 = 1e-13});
  store.commit(deliveries);
  const Database database(file(), Access::read_only);
  Statement row = database.prepare("SELECT run_index, total_m_s2 FROM run_budget");
  for (const Delivery& delivery : deliveries) {
    if (!delivery.result.has_estimate()) continue;
    const double total = microscope_budget(campaign.scenario).of_run(delivery.result).total;
    ASSERT_TRUE(row.step());
    EXPECT_EQ(row.count(0), delivery.result.run.value);
    EXPECT_NEAR(row.real(1), total, 1e-14 * total);
    EXPECT_GT(total, 0.0);
  }
  EXPECT_FALSE(row.step());
}

// Views that show errors: each in a row of its own, the worst ones, those beyond an objective.

using StoreLargestErrors = test::StoreTest;

/// A delivery with this estimate − truth of the parameter with index 4, a_c13, and of no other.
Delivery delivery_with_error(std::uint64_t run, double error) {
  Delivery delivery = delivery_of(run);
  delivery.result.truth.assign(num_parameters, 0.0);
  delivery.result.estimate.assign(num_parameters, 0.0);
  delivery.result.estimate[4] = error;
  return delivery;
}

void commit(Store& store, const Delivery& delivery) { store.commit({&delivery, 1}); }

// All runs in one order, and in another in many transactions: the same ten, ties to the first.
TEST_F(StoreLargestErrors, WorstRunsAreTheSameInWhateverOrderTheyCome) {
  std::vector<Delivery> deliveries;
  for (std::uint64_t run = 0; run < 60; ++run) {
    // 1/16, 3/16, ... 39/16, three times each, with alternating signs.
    const double magnitude = 0.0625 + 0.125 * static_cast<double>(run % 20);
    const double error = run % 2 == 0 ? magnitude : -magnitude;
    deliveries.push_back(delivery_with_error(run, error));
  }
  std::mt19937 random(5);
  std::shuffle(deliveries.begin(), deliveries.end(), random);
  Store store = create(60);
  for (std::size_t first = 0; first < deliveries.size(); first += 7) {
    const std::size_t count = std::min<std::size_t>(7, deliveries.size() - first);
    store.commit(std::span(deliveries).subspan(first, count));
  }
  EXPECT_EQ(text("SELECT group_concat(place || ':' || run_index || ':' || error, ' ')"
                 " FROM worst_runs WHERE parameter = 'a_c13'"),
            "1:19:-2.4375 2:39:-2.4375 3:59:-2.4375 4:18:2.3125 5:38:2.3125 6:58:2.3125"
            " 7:17:-2.1875 8:37:-2.1875 9:57:-2.1875 10:16:2.0625");
  EXPECT_EQ(integer("SELECT count(*) FROM worst_runs"), 100);
  EXPECT_EQ(text("SELECT group_concat(DISTINCT parameter) FROM worst_runs"),
            "a_c11_delta_x,a_c11_delta_z,a_c11_delta_y,a_c12,a_c13,a_d11_prime,a_d12,a_d13,k2d,"
            "k2c");
  // Of errors that are all zero, the first runs.
  EXPECT_EQ(text("SELECT group_concat(run_index) FROM worst_runs WHERE parameter = 'k2c'"),
            "0,1,2,3,4,5,6,7,8,9");
  store.check_integrity();
}

// Ten of them are there: a smaller error of a later coordinator's is none, a larger one drops the
// smallest.
TEST_F(StoreLargestErrors, WorstRunsAreNoMoreThanTenAfterAFileIsOpened) {
  {
    Store store = create(60);
    for (std::uint64_t run = 0; run < 10; ++run) commit(store, delivery_with_error(run, 3.0));
  }
  Store store = Store::open(file());
  commit(store, delivery_with_error(20, 2.0));
  commit(store, delivery_with_error(21, 4.0));
  EXPECT_EQ(text("SELECT group_concat(run_index) FROM worst_runs WHERE parameter = 'a_c13'"),
            "21,0,1,2,3,4,5,6,7,8");
  store.check_integrity();
}

TEST_F(StoreLargestErrors, ASecondResultOfARunChangesNothing) {
  Store store = create(10);
  commit(store, delivery_with_error(3, 0.0));
  commit(store, delivery_with_error(3, 1.0));
  EXPECT_EQ(integer("SELECT count(*) FROM overruns"), 0);
  EXPECT_EQ(integer("SELECT count(*) FROM worst_runs WHERE error = 0"), 10);
}

}  // namespace
}  // namespace proofmass::coordinator
