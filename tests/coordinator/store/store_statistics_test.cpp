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

/// Statistics in which every number is another: parameter i has worst i + 1, and so on.
CampaignStatistics distinct_statistics() {
  CampaignStatistics statistics{.num_runs = 9, .num_estimated = 7, .accuracy = {}};
  statistics.accuracy.resize(num_parameters);
  for (std::size_t i = 0; i < num_parameters; ++i) {
    const double level = static_cast<double>(i) + 1.0;
    AccuracyStatistic& accuracy = statistics.accuracy[i];
    accuracy.worst = level;
    accuracy.worst_run = RunIndex{i + 100};
    accuracy.mean = level / 16.0;
    accuracy.standard_deviation = level / 32.0;
    accuracy.num_beyond_objective = i;
    accuracy.beyond_objective = {level + 400.0, level + 401.0, 0.95};
    accuracy.mean_interval = Interval{level + 100.0, level + 101.0, 0.95};
    accuracy.deviation_interval = Interval{level + 102.0, level + 103.0, 0.95};
    for (std::size_t k = 0; k < percentile_levels.size(); ++k) {
      const double first = level + 200.0 + 3.0 * static_cast<double>(k);
      accuracy.percentiles[k] = {.level = percentile_levels[k],
                                 .value = first,
                                 .interval = Interval{first + 1.0, first + 2.0, 0.95}};
    }
    accuracy.error = {.bias = -level,
                      .bias_interval = Interval{-level - 300.0, -level - 299.0, 0.95},
                      .rms = level + 301.0,
                      .standard_deviation = level + 302.0,
                      .deviation_interval = Interval{level + 303.0, level + 304.0, 0.95},
                      .skewness = level - 305.0};
  }
  return statistics;
}

const ResultDigests digest{.results = std::string(64, '5'), .health = std::string(64, '6')};

/// A budget whose entries are 2 after the worst and 1/8 after the mean of distinct_statistics().
ErrorBudget constant_budgets(double before) {
  ErrorBudget budget = microscope_budget(Scenario{});
  for (BudgetTerm& term : budget.terms) {
    term.before = before;
    term.coefficients.assign(num_parameters, 0.0);
    term.coefficients[0] = 2.0;
  }
  return budget;
}

TEST_F(StoreStatistics, AppearInParameterAccuracyInThePapersOrder) {
  Store store = create(9);
  store.write_statistics(distinct_statistics(), constant_budgets(1), digest);
  const Database database(file(), Access::read_only);
  Statement row = database.prepare(
      "SELECT parameter, unit, objective, num_runs, worst, worst_run_index, num_beyond_objective,"
      " mean, standard_deviation, paper_worst, paper_mean, paper_standard_deviation,"
      " mean_lower, mean_upper, standard_deviation_lower, standard_deviation_upper,"
      " percentile_50, percentile_50_lower, percentile_50_upper,"
      " percentile_90, percentile_90_lower, percentile_90_upper,"
      " percentile_95, percentile_95_lower, percentile_95_upper,"
      " percentile_99, percentile_99_lower, percentile_99_upper,"
      " bias, bias_lower, bias_upper, rms, error_standard_deviation,"
      " error_standard_deviation_lower, error_standard_deviation_upper, skewness,"
      " beyond_objective_lower, beyond_objective_upper, beyond_objective"
      " FROM parameter_accuracy");
  const std::vector<double> objectives = MicroscopeCampaign{}.objectives();
  for (const test::ParameterInfo& info : test::parameter_infos()) {
    const std::size_t i = index(info.parameter);
    const double level = static_cast<double>(i) + 1.0;
    ASSERT_TRUE(row.step());
    EXPECT_EQ(row.text(0), info.name);
    EXPECT_EQ(row.text(1), info.unit);
    std::vector<double> expected{objectives[i],
                                 7.0,
                                 level,
                                 level + 99.0,
                                 level - 1.0,
                                 level / 16.0,
                                 level / 32.0,
                                 info.published->worst,
                                 info.published->mean,
                                 info.published->standard_deviation};
    for (int k = 0; k < 4; ++k) expected.push_back(level + 100.0 + k);
    for (int k = 0; k < 12; ++k) expected.push_back(level + 200.0 + k);
    expected.insert(expected.end(), {-level, -level - 300.0, -level - 299.0});
    for (int k = 0; k < 4; ++k) expected.push_back(level + 301.0 + k);
    expected.insert(expected.end(),
                    {level - 305.0, level + 400.0, level + 401.0, (level - 1.0) / 7.0});
    for (std::size_t k = 0; k < expected.size(); ++k) {
      const int column = static_cast<int>(k) + 2;
      EXPECT_EQ(row.real(column), expected[k]) << row.column_name(column);
    }
  }
  EXPECT_FALSE(row.step());
}

TEST_F(StoreStatistics, HaveNoIntervalWhereRunsAreTooFew) {
  Store store = create(9);
  CampaignStatistics statistics{.num_runs = 1, .num_estimated = 1, .accuracy = {}};
  statistics.accuracy.resize(num_parameters);
  store.write_statistics(statistics, constant_budgets(1), digest);
  EXPECT_EQ(integer("SELECT count(mean) + count(percentile_99) + count(bias) FROM "
                    "parameter_accuracy"),
            30);
  EXPECT_EQ(integer("SELECT count(mean_lower) + count(standard_deviation_upper) +"
                    " count(percentile_50_lower) + count(percentile_99_upper) +"
                    " count(bias_lower) + count(error_standard_deviation_upper)"
                    " FROM parameter_accuracy"),
            0);
}

TEST_F(StoreStatistics, ComeWithASummary) {
  Store store = create(9);
  EXPECT_EQ(store.summary(), std::nullopt);
  store.write(std::vector<Entry>{GivenUpRun{.run = RunIndex{8}}});
  CampaignStatistics statistics = distinct_statistics();
  statistics.num_not_converged = 3;
  statistics.num_not_finite = 1;
  statistics.num_no_draw = 2;
  statistics.num_lost = 4;
  statistics.num_within_objectives = 5;
  const ErrorBudget budget = constant_budgets(1);
  store.write_statistics(statistics, budget, {.results = std::string(64, 'a'), .health = ""});
  store.write_statistics(statistics, budget, digest);
  const std::optional<Summary> summary = Store::open_read_only(file()).summary();
  ASSERT_TRUE(summary);
  EXPECT_THAT(summary->computed_utc, ::testing::MatchesRegex("20[0-9-]+T[0-9:]+Z"));
  EXPECT_EQ(*summary, (Summary{.num_finished = 9,
                               .num_estimated = 7,
                               .num_not_converged = 3,
                               .num_not_finite = 1,
                               .num_no_draw = 2,
                               .num_lost = 4,
                               .num_given_up = 1,
                               .num_within_objectives = 5,
                               .within_objectives = statistics.within_objectives(1),
                               .digests = digest,
                               .computed_utc = summary->computed_utc}));
}

// 5 of 9 finished runs and one that was given up: 18.709 to 81.291 % (scipy.stats.beta.ppf).
TEST_F(StoreStatistics, TellHowOftenAllObjectivesHoldTogether) {
  Store store = create(10);
  store.write(std::vector<Entry>{GivenUpRun{.run = RunIndex{8}}});
  CampaignStatistics statistics = distinct_statistics();
  statistics.num_within_objectives = 5;
  store.write_statistics(statistics, constant_budgets(1), digest);
  const Database database(file(), Access::read_only);
  Statement row = database.prepare(
      "SELECT num_runs, num_within_objectives, within_objectives, within_objectives_lower,"
      " within_objectives_upper FROM joint_accuracy");
  ASSERT_TRUE(row.step());
  EXPECT_EQ(row.count(0), 10u);
  EXPECT_EQ(row.count(1), 5u);
  EXPECT_EQ(row.real(2), 0.5);
  EXPECT_NEAR(row.real(3), 0.187086, 1e-6);
  EXPECT_NEAR(row.real(4), 0.812914, 1e-6);
  EXPECT_FALSE(row.step());
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

TEST_F(StoreStatistics, AppearInBudgetWithItsTotalLast) {
  Store store = create(9);
  store.write_statistics(distinct_statistics(), constant_budgets(1), digest);
  const Database database(file(), Access::read_only);
  Statement row = database.prepare(
      "SELECT label, before_m_s2, after_worst_m_s2, after_mean_m_s2, paper_before_m_s2,"
      " paper_after_worst_m_s2, paper_after_mean_m_s2, term FROM budget");
  for (std::size_t i = 0; i <= num_budget_entries; ++i) {
    const bool is_total = i == num_budget_entries;
    const BudgetEntryInfo& info = is_total ? budget_total_info : budget_entry_infos()[i];
    const double factor = is_total ? 10.0 : 1.0;
    ASSERT_TRUE(row.step());
    EXPECT_EQ(row.text(0), info.label);
    EXPECT_EQ(row.text(7), info.name);
    EXPECT_EQ(row.real(1), factor * 1.0);
    EXPECT_EQ(row.real(2), factor * 2.0);
    EXPECT_EQ(row.real(3), factor * 0.125);
    EXPECT_EQ(row.real(4), info.paper_before);
    EXPECT_EQ(row.real(5), info.paper_after_worst);
    EXPECT_EQ(row.real(6), info.paper_after_mean);
  }
  EXPECT_FALSE(row.step());
}

TEST_F(StoreStatistics, ReplaceTheOlderOnes) {
  Store store = create(9);
  CampaignStatistics statistics = distinct_statistics();
  store.write_statistics(statistics, constant_budgets(1), digest);
  statistics.accuracy[0].worst = 44.0;
  store.write_statistics(statistics, constant_budgets(5), digest);
  EXPECT_EQ(integer("SELECT count(*) FROM parameter_accuracy"), 10);
  EXPECT_EQ(integer("SELECT worst = 44 FROM parameter_accuracy LIMIT 1"), 1);
  EXPECT_EQ(integer("SELECT before_m_s2 = 50 FROM budget WHERE term = 'total'"), 1);
}

TEST_F(StoreStatistics, AreNullWhileNoRunHasAnEstimate) {
  Store store = create(9);
  const auto expect_nulls = [&] {
    EXPECT_EQ(text("SELECT count(*) || ' ' || count(worst) FROM parameter_accuracy"), "10 0");
    EXPECT_EQ(text("SELECT count(before_m_s2) || ' ' || count(after_worst_m_s2) || ' ' ||"
                   " count(after_mean_m_s2) FROM budget"),
              "11 0 0");
  };
  expect_nulls();
  store.write_statistics({.num_runs = 2, .num_no_draw = 2, .accuracy = {}}, constant_budgets(1),
                         digest);
  expect_nulls();
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

TEST_F(StoreLargestErrors, ErrorsInLongFormAreThoseOfTheResults) {
  Store store = create(10);
  std::vector<Delivery> deliveries = test::deliveries_of(0, 4);
  deliveries[1].result.status = RunStatus::not_finite;
  deliveries[2].result.status = RunStatus::not_converged;
  deliveries[3].result.status = RunStatus::no_draw;
  store.commit(deliveries);
  const Database database(file(), Access::read_only);
  Statement row = database.prepare(
      "SELECT run_index, e.parameter, e.unit, truth, estimate, error FROM error_long AS e"
      " JOIN parameter AS p USING (parameter) ORDER BY run_index, position");
  for (const std::uint64_t run : {0u, 2u}) {
    for (const test::ParameterInfo& info : test::parameter_infos()) {
      const RunResult& result = deliveries[run].result;
      ASSERT_TRUE(row.step());
      EXPECT_EQ(row.count(0), run);
      EXPECT_EQ(row.text(1), info.name);
      EXPECT_EQ(row.text(2), info.unit);
      EXPECT_EQ(row.real(3), result.truth[index(info.parameter)]);
      EXPECT_EQ(row.real(4), result.estimate[index(info.parameter)]);
      EXPECT_EQ(row.real(5), result.error(index(info.parameter)));
    }
  }
  EXPECT_FALSE(row.step());
}

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

TEST_F(StoreLargestErrors, OverrunsAreErrorsAboveTheObjectiveOnly) {
  const double objective = MicroscopeCampaign{}.objectives()[4];
  Store store = create(10);
  std::vector<Delivery> deliveries{
      delivery_with_error(3, -2.0 * objective), delivery_with_error(1, objective),
      delivery_with_error(2, std::nextafter(objective, 1.0)), delivery_with_error(4, 0.0)};
  deliveries[3].result.estimate[0] = 1.0;
  deliveries[3].result.estimate[9] = 1e9;
  deliveries.push_back(delivery_with_error(5, 1.0));
  deliveries.back().result.status = RunStatus::not_finite;
  store.commit(deliveries);
  EXPECT_EQ(text("SELECT group_concat(run_index || ' ' || parameter, ';') FROM"
                 " (SELECT * FROM overruns ORDER BY run_index, ratio)"),
            "2 a_c13;3 a_c13;4 k2c;4 a_c11_delta_x");
  const Database database(file(), Access::read_only);
  Statement row =
      database.prepare("SELECT unit, objective, error, ratio FROM overruns WHERE run_index = 3");
  ASSERT_TRUE(row.step());
  EXPECT_EQ(row.text(0), "rad");
  EXPECT_EQ(row.real(1), objective);
  EXPECT_EQ(row.real(2), -2.0 * objective);
  EXPECT_EQ(row.real(3), 2.0);
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
