#include "coordinator/report/standard_errors.hpp"

#include "coordinator/charts/chart.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/table/table.hpp"
#include "tests/coordinator/charts/markup_reading.hpp"
#include "tests/coordinator/report/review_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

const std::vector<double> pulls{-3.0, -1.0, 0.5, 1.5, 2.0};

StandardErrorStatistics of_five_runs(bool are_independent = true) {
  RunningStandardErrors running(test::schema(), are_independent);
  for (std::size_t run = 0; run < pulls.size(); ++run)
    running.add(test::result_off_by(run, pulls[run]));
  running.add(test::result_of(5));                            // Without standard errors.
  running.add(test::result_of(6, RunStatus::not_converged));  // Counts as a miss elsewhere.
  return running.statistics();
}

// Squares of the pulls: 9, 1, 0.25, 2.25 and 4, whose mean is 3.3. Five squares of normal values
// of variance 1 have a mean of variance 2/5.
TEST(StandardErrors, AreHeldAgainstTheErrors) {
  const StandardErrorStatistics statistics = of_five_runs();
  ASSERT_EQ(statistics.quantities.size(), 10U);
  const std::vector<double> objectives = test::campaign_of(1).objectives();
  for (const StandardErrorStatistic& of : statistics.quantities) {
    EXPECT_EQ(of.num_runs, 5U);
    EXPECT_NEAR(of.mean / objectives[of.quantity], 0.1, 1e-15);
    EXPECT_NEAR(of.squared_ratio.value(), 3.3, 1e-12);
    EXPECT_NEAR(of.squared_ratio_error.value(), std::sqrt(2.0 / 5.0), 1e-12);
    EXPECT_EQ(of.num_within, 3U);
    EXPECT_NEAR(of.pulls.edges.front(), -3.0, 0.126);  // Bins are 1/8 wide.
    std::uint64_t num_runs = 0;
    for (const std::uint64_t count : of.pulls.counts) num_runs += count;
    EXPECT_EQ(num_runs, 5U);
  }
  ASSERT_EQ(statistics.fit.size(), 1U);  // 30 to 34 of 32.
  EXPECT_EQ(statistics.fit[0].chi_squared, 32.0);
  EXPECT_EQ(statistics.fit[0].ratio, 1.0);
}

// Without noise there is nothing to hold the errors against.
TEST(StandardErrors, HaveNoRatioWhereTheyAreZero) {
  RunningStandardErrors running(test::schema());
  for (std::size_t run = 0; run < pulls.size(); ++run) {
    RunResult result = test::result_off_by(run, pulls[run]);
    std::ranges::fill(result.standard_error, 0.0);
    running.add(result);
  }
  const StandardErrorStatistics statistics = running.statistics();
  for (const StandardErrorStatistic& of : statistics.quantities) {
    EXPECT_EQ(of.squared_ratio, std::nullopt);
    EXPECT_EQ(of.squared_ratio_error, std::nullopt);
  }
  EXPECT_THAT(terminal_text(standard_error_table(test::schema(), statistics), {}),
              ::testing::ContainsRegex("a_c12 +1e-4 rad +0 .* - +- .*0 +0 +52.2"));
}

// 3 of 5 by Clopper and Pearson: 14.7 % to 94.7 %.
TEST(StandardErrors, HaveATableAndAChartOfTheirPulls) {
  const StandardErrorStatistics statistics = of_five_runs();
  const std::string text = terminal_text(standard_error_table(test::schema(), statistics), {});
  EXPECT_THAT(text, HasSubstr("Standard errors σ of the estimates of 5 runs"));
  EXPECT_THAT(text, ::testing::ContainsRegex(
                        "a_c12 +1e-4 rad +0.900 .* +3.30 +0.632 .* +60.0 +14.7 +94.7"));
  const std::string svg = svg_of(*pull_overview(test::schema(), statistics), SvgUse::embedded);
  EXPECT_EQ(test::malformed_part(svg), "");
  EXPECT_THAT(svg, AllOf(HasSubstr("a_c12: 60 % of the runs."), HasSubstr("normal law"),
                         HasSubstr("dotted: ±1.96<")));
  EXPECT_EQ(test::tags_of(svg, "stroke-dasharray=\"2 3\"").size(),
            2 * statistics.quantities.size());
}

TEST(StandardErrors, HaveNoColumnsOfIntervalsOfDrawsThatAreNotIndependent) {
  const StandardErrorStatistics statistics = of_five_runs(false);
  const std::string text = terminal_text(standard_error_table(test::schema(), statistics), {});
  EXPECT_THAT(text, ::testing::ContainsRegex("a_c12 +1e-4 rad +0.900 .* +3.30 .* +60.0\n"));
  EXPECT_THAT(text, AllOf(Not(HasSubstr("±")), Not(HasSubstr("interval"))));
}

TEST(StandardErrors, AreNowhereWithoutAny) {
  RunningStandardErrors running(test::schema());
  running.add(test::result_of(0));
  EXPECT_TRUE(standard_error_table(test::schema(), running.statistics()).rows.empty());
  EXPECT_FALSE(pull_overview(test::schema(), running.statistics()));
}

using StandardErrorsTest = test::ReviewTest;

TEST_F(StandardErrorsTest, AreInEveryReport) {
  const MicroscopeCampaign campaign = test::campaign_of(5);
  Store store = Store::create(file(), campaign, canonical_definition(campaign));
  std::vector<Delivery> deliveries;
  for (std::size_t run = 0; run < pulls.size(); ++run) {
    deliveries.push_back(test::delivery_of(run));
    deliveries.back().result = test::result_off_by(run, pulls[run]);
  }
  store.commit(deliveries);
  const std::string caption = "Standard errors σ of the estimates of 5 runs";
  const Review review = review_of(store, 5);
  const auto is_there = AllOf(HasSubstr(caption), HasSubstr("Fit of the estimates to the data"));
  EXPECT_THAT(report_text(review), is_there);
  EXPECT_THAT(review_html(review), AllOf(is_there, HasSubstr("id=\"pulls-title\"")));
  EXPECT_THAT(review_markdown(review), is_there);
  EXPECT_THAT(report_json(review).dump(2),
              AllOf(HasSubstr("\"num_within_95\": 3"), HasSubstr("\"mean_chi_squared\": 32.0")));
}

TEST_F(StandardErrorsTest, AreInNoReportWithoutThem) {
  const Store store = store_with(5);
  EXPECT_THAT(review_html(review_of(store, 5)), Not(HasSubstr("tandard error")));
  EXPECT_THAT(review_markdown(review_of(store, 5)), Not(HasSubstr("tandard error")));
  EXPECT_THAT(report_json(review_of(store, 5)).dump(2), HasSubstr("\"standard_errors\": null"));
}

}  // namespace
}  // namespace proofmass::coordinator
