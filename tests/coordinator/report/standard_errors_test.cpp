#include "coordinator/report/standard_errors.hpp"

#include "coordinator/charts/chart.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/table/table.hpp"
#include "tests/coordinator/charts/markup_reading.hpp"
#include "tests/coordinator/report/review_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::ContainsRegex;

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

// √(2 Σσ⁴)/Σσ² of five equal ones, whatever their unit: σ⁴ alone would not be a double.
TEST(StandardErrors, MayHaveAnyUnit) {
  for (const double unit : {1e-85, 1e80}) {
    RunningStandardErrors running(test::schema());
    for (std::size_t run = 0; run < pulls.size(); ++run) {
      RunResult result = test::result_off_by(run, pulls[run]);
      std::ranges::fill(result.standard_error, unit);
      running.add(result);
    }
    for (const StandardErrorStatistic& of : running.statistics().quantities) {
      EXPECT_NEAR(of.squared_ratio_error.value(), std::sqrt(2.0 / 5.0), 1e-12);
    }
  }
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
              ContainsRegex("a_c12 +1e-4 rad +0 .* - +- .*0 +0 +52.2"));
}

// 3 of 5 by Clopper and Pearson: 14.7 % to 94.7 %.
TEST(StandardErrors, HaveATableAndAChartOfTheirPulls) {
  const StandardErrorStatistics statistics = of_five_runs();
  const std::string text = terminal_text(standard_error_table(test::schema(), statistics), {});
  EXPECT_THAT(text, HasSubstr("Standard errors σ of the estimates of 5 runs"));
  EXPECT_THAT(text, ContainsRegex("a_c12 +1e-4 rad +0.900 .* +3.30 +0.632 .* +60.0 +14.7 +94.7"));
  const std::string svg = svg_of(*pull_overview(test::schema(), statistics), SvgUse::embedded);
  EXPECT_EQ(test::malformed_part(svg), "");
  EXPECT_THAT(svg, AllOf(HasSubstr("a_c12: 60 % of the runs."),
                         HasSubstr("dashed: normal law; dotted: ±1.96<")));
  EXPECT_EQ(test::tags_of(svg, "stroke-dasharray=\"2 3\"").size(),
            2 * statistics.quantities.size());
}

TEST(StandardErrors, HaveNoColumnsOfIntervalsOfDrawsThatAreNotIndependent) {
  const StandardErrorStatistics statistics = of_five_runs(false);
  const std::string text = terminal_text(standard_error_table(test::schema(), statistics), {});
  EXPECT_THAT(text, ContainsRegex("a_c12 +1e-4 rad +0.900 .* +3.30 .* +60.0\n"));
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

/// Of two sessions, the noise of which the method knows.
ResultSchema schema_of_two() {
  ResultSchema schema = test::schema();
  schema.fit_parts = {"a_c12", "a_c13"};
  schema.fit_tolerance = 0.0;
  return schema;
}

RunResult result_with(std::vector<double> fit) {
  RunResult result = test::result_off_by(0, 1.0);
  result.fit = std::move(fit);
  return result;
}

std::vector<FitStatistic> fit_of(const std::vector<std::vector<double>>& runs,
                                 const ResultSchema& schema = schema_of_two(),
                                 bool are_draws_independent = true) {
  RunningStandardErrors running(schema, are_draws_independent);
  for (const std::vector<double>& fit : runs) running.add(result_with(fit));
  return running.statistics().fit;
}

// χ² of 4 degrees is above x with the chance e^(−x/2) (1 + x/2), and of 2 degrees e^(−x/2). Each is
// doubled, as ratios below 1 count too, and taken three times.
TEST(Fit, HasTheChanceOfTheChiSquareLaw) {
  const std::vector<FitStatistic> fit = fit_of({{20.1, 6.0, 20.0, 4.0, 0.1, 2.0}});
  ASSERT_EQ(fit.size(), 3U);
  EXPECT_EQ(fit[0].session, "all");
  EXPECT_EQ(fit[1].session, "a_c12");
  EXPECT_EQ(fit[1].ratio, 5.0);
  EXPECT_NEAR(*fit[1].p_value, 6.0 * std::exp(-10.0) * 11.0, 1e-15);
  EXPECT_NEAR(*fit[2].p_value, 6.0 * (1.0 - std::exp(-0.05)), 1e-14);
  EXPECT_FALSE(fit[1].ratio_error);
  // Twice the run: 8 degrees and 40, e^(−20) (1 + 20 + 200 + 8000/6).
  EXPECT_NEAR(
      *fit_of({{20.1, 6.0, 20.0, 4.0, 0.1, 2.0}, {20.1, 6.0, 20.0, 4.0, 0.1, 2.0}})[1].p_value,
      6.0 * std::exp(-20.0) * (221.0 + 8000.0 / 6.0), 1e-18);
}

// The noise may be off by the tolerance, either way.
TEST(Fit, AllowsForWhatTheNoiseIsOffBy) {
  ResultSchema schema = schema_of_two();
  schema.fit_tolerance = 0.25;
  const std::vector<FitStatistic> fit = fit_of({{20.0, 6.0, 20.0, 4.0, 0.12, 2.0}}, schema);
  EXPECT_NEAR(*fit[1].p_value, 6.0 * std::exp(-8.0) * 9.0, 1e-15);
  EXPECT_NEAR(*fit[2].p_value, 6.0 * (1.0 - std::exp(-0.08)), 1e-14);
}

// Ratios 1.5 and 0.5 with equal degrees: their mean 1 has the standard deviation √(1/2)/√2.
TEST(Fit, HasTheStandardErrorOfTheRatio) {
  const std::vector<FitStatistic> fit =
      fit_of({{6.0, 4.0, 6.0, 4.0, 0.0, 0.0}, {2.0, 4.0, 2.0, 4.0, 0.0, 0.0}});
  EXPECT_EQ(fit[1].ratio, 1.0);
  EXPECT_EQ(fit[1].chi_squared, 4.0);
  EXPECT_EQ(fit[1].degrees_of_freedom, 4.0);
  EXPECT_NEAR(fit[1].ratio_error.value(), 0.5, 1e-12);
}

// As a test of the equivalence principle, which would also count among the ratios of each p: of 20
// with 4 degrees, twice e^(−10) 11 for each of two ratios.
TEST(Fit, LeavesOutASessionThatHasNoPartInIt) {
  const std::vector<FitStatistic> fit = fit_of({{20.0, 4.0, 20.0, 4.0, 0.0, 0.0}});
  ASSERT_EQ(fit.size(), 2u);
  EXPECT_NEAR(*fit[1].p_value, 4.0 * std::exp(-10.0) * 11.0, 1e-15);
}

// Campaigns of 5 runs in which all is as it should be: at most one in twenty has a session that
// does not fit, and by Bonferroni's inequality for three of which one is the sum of the others, not
// many fewer. 4000 of them tell the share to 0.0034, one standard error.
TEST(Fit, RaisesNoFalseAlarmMoreOftenThanItSays) {
  std::mt19937_64 random(42);
  constexpr int num_campaigns = 4000;
  int num_alarms = 0;
  for (int i = 0; i < num_campaigns; ++i) {
    std::vector<std::vector<double>> runs;
    for (int run = 0; run < 5; ++run) {
      const double a = std::chi_squared_distribution<>(3.0)(random);
      const double b = std::chi_squared_distribution<>(8.0)(random);
      runs.push_back({a + b, 11.0, a, 3.0, b, 8.0});
    }
    bool is_alarm = false;
    for (const FitStatistic& of : fit_of(runs)) is_alarm = is_alarm || *of.p_value < 0.05;
    if (is_alarm) ++num_alarms;
  }
  const double share = num_alarms / static_cast<double>(num_campaigns);
  EXPECT_LT(share, 0.05 + 4.0 * 0.0034);
  EXPECT_GT(share, 0.03);
}

// A test of the equivalence principle has a standard error where its calibration has none.
TEST(Fit, IsNoneWhereStandardErrorsHaveNone) {
  ResultSchema schema = test::schema();
  schema.fit.clear();
  EXPECT_TRUE(fit_of({{}}, schema).empty());
}

TEST(Fit, HasATableThatSaysWhatDoesNotFit) {
  const std::vector<std::vector<double>> runs{{20.1, 6.0, 20.0, 4.0, 2.0, 2.0},
                                              {21.0, 6.0, 19.0, 4.0, 2.0, 2.0}};
  const auto text = [&](bool are_independent) {
    const auto fit = fit_of(runs, schema_of_two(), are_independent);
    return terminal_text(fit_table(schema_of_two(), fit), {});
  };
  EXPECT_THAT(text(true), AllOf(ContainsRegex("a_c12 +19.5 +4.00 +4.88 .* does not fit"),
                                ContainsRegex("a_c13 +2.00 +2.00 +1.00 +0 +1.00\n"),
                                HasSubstr("chance that one of 3 ratios")));
  EXPECT_THAT(text(false),
              AllOf(HasSubstr("4.88"), Not(HasSubstr("fit\n")), Not(HasSubstr("chance"))));
  EXPECT_TRUE(fit_table(schema_of_two(), fit_of({})).rows.empty());
}

}  // namespace
}  // namespace proofmass::coordinator
