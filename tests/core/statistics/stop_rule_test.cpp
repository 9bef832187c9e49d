#include "core/statistics/stop_rule.hpp"

#include <gtest/gtest.h>

#include <span>
#include <string>
#include <vector>

#include "core/error.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/message_of.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass {
namespace {

std::string refusal_of_rule(std::string_view text) {
  return test::message_of<ConfigError>([&] { (void)parse_stop_rule(text); });
}

TEST(ParseStopRule, ReadsEveryStatistic) {
  const StopRule spread = parse_stop_rule("std(a_c13) within 5%");
  EXPECT_EQ(spread.statistic, StopRule::Statistic::standard_deviation);
  EXPECT_EQ(spread.parameter, index(Parameter::a_c13));
  EXPECT_EQ(spread.relative_half_width, 0.05);
  EXPECT_EQ(parse_stop_rule(" mean ( k2d )within 0.5 %").statistic, StopRule::Statistic::mean);
  const StopRule percentile = parse_stop_rule("p95(k2c) within 10%");
  EXPECT_EQ(percentile.statistic, StopRule::Statistic::percentile);
  EXPECT_EQ(percentile.level, 0.95);
}

TEST(ParseStopRule, RefusesAnUnknownStatistic) {
  for (const std::string name : {"max", "p0", "p100", "p9x", "p"}) {
    EXPECT_EQ(refusal_of_rule(name + "(k2c) within 5%"),
              "until = " + name + "(k2c) within 5% (" + name +
                  " is no statistic; they are mean, std and p1 to p99)");
  }
}

TEST(ParseStopRule, RefusesAnotherForm) {
  for (const std::string text :
       {"", "std a_c13 within 5%", "std(a_c13) in 5%", "std(a_c13) within 5",
        "std(a_c13) within 5% or less", "a_c12 < 1 for 9% decided", "all within 5%", "< decided",
        "a_c12 < 1 for 9% with 9% soon decided"}) {
    EXPECT_EQ(refusal_of_rule(text),
              "until = " + text +
                  " (must read \"STATISTIC(PARAMETER) within PERCENT%\", \"all objectives within "
                  "PERCENT%\" or \"REQUIREMENT decided\")");
  }
}

TEST(ParseStopRule, ReadsARequirement) {
  const StopRule rule = parse_stop_rule("a_c12 < 9e-4 for 99% with 95% decided ");
  EXPECT_EQ(rule.statistic, StopRule::Statistic::verdict);
  EXPECT_EQ(rule.requirement.parameter, index(Parameter::a_c12));
  EXPECT_EQ(rule.requirement.limit, 9e-4);
  const StopRule joint = parse_stop_rule("all objectives for 95% with 90% decided");
  EXPECT_EQ(joint.requirement.subject, Requirement::Subject::all_objectives);
  const StopRule success = parse_stop_rule("all objectives within 2%");
  EXPECT_EQ(success.statistic, StopRule::Statistic::success);
  EXPECT_EQ(success.relative_half_width, 0.02);
}

TEST(StatisticOf, NamesWhatTheRuleIsAbout) {
  EXPECT_EQ(statistic_of("std(a_c13) within 5%"), "std(a_c13)");
  EXPECT_EQ(statistic_of(" all objectives within 2%"), "all objectives");
  EXPECT_EQ(statistic_of("a_c12 < 9e-4 for 99% with 95% decided "),
            "a_c12 < 9e-4 for 99% with 95% decided");
}

TEST(ParseStopRule, RefusesAWidthOutsideItsRange) {
  EXPECT_EQ(refusal_of_rule("std(a_c13) within 0%"),
            "until = std(a_c13) within 0% (0% must be above 0% and below 100%)");
}

TEST(NextStopCheck, WalksThroughFixedCounts) {
  std::vector<std::uint64_t> counts;
  for (std::uint64_t n = 0; n < 1500;) counts.push_back(n = next_stop_check(n));
  EXPECT_EQ(counts, (std::vector<std::uint64_t>{128, 192, 256, 384, 512, 768, 1024, 1536}));
}

// Whatever count it is asked from, the next one is the first of the list above it.
TEST(NextStopCheck, DependsOnlyOnTheListOfCounts) {
  EXPECT_EQ(next_stop_check(127), 128u);
  EXPECT_EQ(next_stop_check(150), 192u);
  EXPECT_EQ(next_stop_check(200), 256u);
  EXPECT_EQ(next_stop_check(999'999'999), 1'073'741'824u);
}

// The 95 % interval of a deviation of normal values has half width 1.96/√(2n): 4.3 % with n = 1024.
TEST(CheckStopRule, IsReachedWhenTheIntervalIsNarrow) {
  StopRule rule = parse_stop_rule("std(a_c13) within 5%");
  const std::vector<double> errors = test::normal_column(1024, {.seed = 61});
  const StopCheck check = check_stop_rule(rule, errors);
  EXPECT_TRUE(check.is_reached);
  EXPECT_NEAR(*check.relative_half_width, 0.0433, 0.006);
  EXPECT_EQ(check.estimate, moments(errors).standard_deviation);
  EXPECT_EQ(check.interval->lower, bootstrap_deviation_interval(errors, 0.95)->lower);

  rule.relative_half_width = 0.03;
  EXPECT_FALSE(check_stop_rule(rule, errors).is_reached);
}

TEST(CheckStopRule, TakesTheIntervalOfItsStatistic) {
  const std::vector<double> errors = test::half_normal_column(400, {.seed = 62});
  const StopCheck mean = check_stop_rule(parse_stop_rule("mean(k2c) within 9%"), errors);
  EXPECT_EQ(mean.estimate, moments(errors).mean);
  EXPECT_EQ(mean.interval->upper, mean_interval(moments(errors), 0.95)->upper);
  const StopCheck percentile_check = check_stop_rule(parse_stop_rule("p90(k2c) within 9%"), errors);
  EXPECT_EQ(percentile_check.estimate, percentile(sorted(errors), 0.9));
  EXPECT_EQ(percentile_check.interval->upper,
            percentile_interval(sorted(errors), 0.9, 0.95)->upper);
}

TEST(CheckStopRule, IsNotReachedWithoutAnInterval) {
  const StopRule rule = parse_stop_rule("p99(k2c) within 50%");
  const StopCheck check = check_stop_rule(rule, test::half_normal_column(100, {.seed = 63}));
  EXPECT_FALSE(check.is_reached);
  EXPECT_FALSE(check.relative_half_width.has_value());
  EXPECT_FALSE(check_stop_rule(rule, std::span<const double>()).is_reached);
}

// Half of 128 runs have no error at all; whether the median of all is 0 is open.
TEST(CheckStopRule, IsNotReachedByAnIntervalAboutZero) {
  std::vector<double> errors(66, 0.0);
  errors.resize(128, 1.0);
  const StopCheck check = check_stop_rule(parse_stop_rule("p50(k2c) within 50%"), errors);
  EXPECT_EQ(check.estimate, 0.0);
  ASSERT_TRUE(check.interval.has_value());
  EXPECT_GT(check.interval->upper, 0.0);
  EXPECT_FALSE(check.relative_half_width.has_value());
  EXPECT_FALSE(check.is_reached);
}

// 97 of 100: 91.48 to 99.38 % (scipy.stats.beta.ppf), half of which is 4.07 % of 97 %.
TEST(CheckStopRule, KnowsHowOftenAllObjectivesHold) {
  const ExceedanceCount count{.num_runs = 100, .num_exceedances = 3};
  const StopCheck check = check_stop_rule(parse_stop_rule("all objectives within 4%"), count, {});
  EXPECT_EQ(check.estimate, 0.97);
  EXPECT_NEAR(check.interval->lower, 0.91482394702572, 1e-13);
  EXPECT_NEAR(check.interval->upper, 0.9937700284616936, 1e-13);
  EXPECT_NEAR(*check.relative_half_width, 0.0407, 1e-4);
  EXPECT_FALSE(check.is_reached);
  EXPECT_TRUE(check_stop_rule(parse_stop_rule("all objectives within 4.1%"), count, {}).is_reached);
}

TEST(CheckStopRule, IsReachedWhenARequirementIsDecided) {
  const StopRule rule = parse_stop_rule("a_c12 < 9e-4 for 99% with 95% decided");
  EXPECT_FALSE(check_stop_rule(rule, ExceedanceCount{}, {}).is_reached);
  EXPECT_FALSE(check_stop_rule(rule, ExceedanceCount{.num_runs = 256}, {}).is_reached);
  const StopCheck met = check_stop_rule(rule, ExceedanceCount{.num_runs = 384}, {});
  EXPECT_TRUE(met.is_reached);
  EXPECT_LT(met.interval->upper, 0.01);
  EXPECT_FALSE(met.relative_half_width.has_value());
  const StopCheck not_met =
      check_stop_rule(rule, ExceedanceCount{.num_runs = 128, .num_exceedances = 20}, {});
  EXPECT_TRUE(not_met.is_reached);
  EXPECT_EQ(not_met.estimate, 20.0 / 128.0);
}

TEST(CheckStopRule, TakesAnExactZeroForKnown) {
  const StopRule rule = parse_stop_rule("std(k2c) within 5%");
  EXPECT_TRUE(check_stop_rule(rule, std::vector<double>(128, 0.0)).is_reached);
}

}  // namespace
}  // namespace proofmass
