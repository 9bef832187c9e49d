// What Store::write_statistics() shows through the views that people query.

#include <gmock/gmock.h>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/store.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using detail::Statement;
using test::campaign_of;

using StoreStatistics = test::StoreTest;

/// Statistics in which every number is another: parameter i has worst i + 1, and so on.
CampaignStatistics distinct_statistics() {
  CampaignStatistics statistics{.num_runs = 9, .num_estimated = 7};
  for (std::size_t i = 0; i < num_parameters; ++i) {
    const double level = static_cast<double>(i) + 1.0;
    AccuracyStatistic& accuracy = statistics.accuracy[i];
    accuracy.worst = level;
    accuracy.worst_run = RunIndex{i + 100};
    accuracy.mean = level / 16.0;
    accuracy.standard_deviation = level / 32.0;
    accuracy.num_beyond_objective = i;
  }
  return statistics;
}

const std::string digest(64, '5');

Budget constant_budget(double entry) {
  Budget budget;
  budget.entries.fill(entry);
  budget.total = 10.0 * entry;
  return budget;
}

TEST_F(StoreStatistics, AppearInParameterAccuracyInThePapersOrder) {
  Store store = Store::create(file(), campaign_of(9), "");
  store.write_statistics(distinct_statistics(), constant_budget(1), constant_budget(2),
                         constant_budget(3), digest);
  const Database database(file(), Access::read_only);
  Statement row = database.prepare(
      "SELECT parameter, unit, objective, worst, mean, standard_deviation, num_beyond_objective,"
      " num_runs, worst_run_index, paper_worst, paper_mean, paper_standard_deviation"
      " FROM parameter_accuracy");
  const ParameterArray objectives = Scenario{}.objectives;
  for (const ParameterInfo& info : parameter_infos()) {
    const std::size_t i = index(info.parameter);
    const double level = static_cast<double>(i) + 1.0;
    ASSERT_TRUE(row.step());
    EXPECT_EQ(row.text(0), info.name);
    EXPECT_EQ(row.text(1), info.unit);
    EXPECT_EQ(row.real(2), objectives[i]);
    EXPECT_EQ(row.real(3), level);
    EXPECT_EQ(row.real(4), level / 16.0);
    EXPECT_EQ(row.real(5), level / 32.0);
    EXPECT_EQ(row.count(6), i);
    EXPECT_EQ(row.integer(7), 7);
    EXPECT_EQ(row.count(8), i + 100);
    EXPECT_EQ(row.real(9), info.paper.worst);
    EXPECT_EQ(row.real(10), info.paper.mean);
    EXPECT_EQ(row.real(11), info.paper.standard_deviation);
  }
  EXPECT_FALSE(row.step());
}

TEST_F(StoreStatistics, AppearInBudgetWithItsTotalLast) {
  Store store = Store::create(file(), campaign_of(9), "");
  store.write_statistics(distinct_statistics(), constant_budget(1), constant_budget(2),
                         constant_budget(3), digest);
  const Database database(file(), Access::read_only);
  Statement row = database.prepare(
      "SELECT term, before_m_s2, after_worst_m_s2, after_mean_m_s2, paper_before_m_s2,"
      " paper_after_worst_m_s2, paper_after_mean_m_s2 FROM budget");
  for (std::size_t i = 0; i <= num_budget_entries; ++i) {
    const bool is_total = i == num_budget_entries;
    const BudgetEntryInfo& info = is_total ? budget_total_info : budget_entry_infos()[i];
    const double factor = is_total ? 10.0 : 1.0;
    ASSERT_TRUE(row.step());
    EXPECT_EQ(row.text(0), info.label);
    EXPECT_EQ(row.real(1), factor * 1.0);
    EXPECT_EQ(row.real(2), factor * 2.0);
    EXPECT_EQ(row.real(3), factor * 3.0);
    EXPECT_EQ(row.real(4), info.paper_before);
    EXPECT_EQ(row.real(5), info.paper_after_worst);
    EXPECT_EQ(row.real(6), info.paper_after_mean);
  }
  EXPECT_FALSE(row.step());
}

TEST_F(StoreStatistics, ReplaceTheOlderOnes) {
  Store store = Store::create(file(), campaign_of(9), "");
  CampaignStatistics statistics = distinct_statistics();
  store.write_statistics(statistics, constant_budget(1), constant_budget(2), constant_budget(3),
                         digest);
  statistics.accuracy[0].worst = 44.0;
  store.write_statistics(statistics, constant_budget(5), constant_budget(2), constant_budget(3),
                         digest);
  const Database database(file(), Access::read_only);
  EXPECT_EQ(database.integer("SELECT count(*) FROM parameter_accuracy"), 10);
  EXPECT_EQ(database.integer("SELECT worst = 44 FROM parameter_accuracy LIMIT 1"), 1);
  EXPECT_EQ(database.integer("SELECT before_m_s2 = 50 FROM budget WHERE term = 'Total'"), 1);
}

TEST_F(StoreStatistics, AreNullWhileNoRunHasAnEstimate) {
  Store store = Store::create(file(), campaign_of(9), "");
  const Database database(file(), Access::read_only);
  const auto expect_nulls = [&] {
    EXPECT_EQ(database.integer("SELECT count(*) FROM parameter_accuracy"), 10);
    EXPECT_EQ(database.integer("SELECT count(worst) FROM parameter_accuracy"), 0);
    EXPECT_EQ(database.integer("SELECT count(before_m_s2) FROM budget"), 11);
    EXPECT_EQ(
        database.integer("SELECT count(after_worst_m_s2) + count(after_mean_m_s2) FROM budget"), 0);
  };
  expect_nulls();
  store.write_statistics({.num_runs = 2, .num_no_draw = 2}, constant_budget(1), Budget{}, Budget{},
                         digest);
  expect_nulls();
}

}  // namespace
}  // namespace proofmass::coordinator
