#include "coordinator/report/standard_errors.hpp"
#include "coordinator/table/table.hpp"
#include "tests/coordinator/report/review_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::ContainsRegex;

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
  EXPECT_EQ(fit[2].ratio, 0.0);
  EXPECT_FALSE(fit[2].p_value || fit[2].ratio_error);
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
