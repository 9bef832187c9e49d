#include "core/statistics/requirement.hpp"

#include "core/error.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"
#include "core/statistics/stop_rule.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

const Requirement a_c12_99_95{index(Parameter::a_c12), 9e-4, {0.99, 0.95}};

/// So many errors below the limit of 9e-4, then so many on it.
std::vector<double> errors_with(std::size_t num_below, std::size_t num_on_limit) {
  std::vector<double> errors(num_below, 1e-4);
  errors.insert(errors.end(), num_on_limit, 9e-4);
  return errors;
}

/// The check of a number of runs that was fixed beforehand.
RequirementCheck fixed_check(const Requirement& requirement, const std::vector<double>& errors,
                             std::uint64_t num_without_estimate) {
  const auto num_above =
      std::ranges::count_if(errors, [&](double error) { return error >= requirement.limit; });
  const std::uint64_t num_runs = errors.size() + num_without_estimate;
  return check_requirement(
      requirement,
      {.num_runs = num_runs,
       .num_exceedances = static_cast<std::uint64_t>(num_above) + num_without_estimate,
       .num_without_estimate = num_without_estimate},
      num_runs);
}

std::string refusal(std::string_view text) {
  return test::message_of<ConfigError>([&] { (void)test::parse_requirement(text); });
}

TEST(ParseRequirement, TakesBlanksAsTheyCome) {
  const Requirement requirement = test::parse_requirement("  k2d<1000 for 99.9 %  with 90% ");
  EXPECT_EQ(requirement.parameter, index(Parameter::k2d));
  EXPECT_EQ(requirement.limit, 1000.0);
  EXPECT_FALSE(requirement.admits_limit);
  EXPECT_TRUE(test::parse_requirement("k2d<=1000 for 99.9% with 90%").admits_limit);
  EXPECT_DOUBLE_EQ(requirement.tolerance.coverage, 0.999);
}

TEST(ParseRequirement, RefusesNumbersOutsideTheirRange) {
  EXPECT_EQ(refusal("k2c < -1 for 9% with 9%"),
            "requirement = k2c < -1 for 9% with 9% (-1 must be finite and > 0)");
  EXPECT_EQ(refusal("k2c < inf for 9% with 9%"),
            "requirement = k2c < inf for 9% with 9% (inf must be finite and > 0)");
  EXPECT_EQ(refusal("k2c < 1 for 100% with 9%"),
            "requirement = k2c < 1 for 100% with 9% (100% must be above 0% and below 100%)");
}

// Of 300 runs 5 exceed: P(≤ 5) is 0.917 and P(≥ 5) is 0.185 if 1 % of all draws do.
TEST(RequireAnswerable, RefusesARiskForAConfidence) {
  const auto refusal_of = [](const std::string& text) {
    return test::message_of<ConfigError>(
        [&] { require_answerable(test::parse_requirement(text), {}, "requirement", text); });
  };
  EXPECT_EQ(refusal_of("k2c < 1 for 99% with 7%"),
            "requirement = k2c < 1 for 99% with 7% (its confidence must be at least 50%: with "
            "less, the same runs would show a requirement and its contrary)");
  EXPECT_EQ(refusal_of("k2c < 1 for 99% with 50%"), "");
}

// 0.99²⁹⁹ = 0.0495: 299 runs without an exceedance show it, 298 do not.
TEST(CheckRequirement, IsMetWithEnoughRunsBelowTheLimit) {
  const RequirementCheck check = fixed_check(a_c12_99_95, errors_with(299, 0), 0);
  EXPECT_EQ(check.verdict, RequirementVerdict::met);
  EXPECT_EQ(check.num_runs, 299u);
  EXPECT_EQ(check.num_exceedances, 0u);
  EXPECT_EQ(check.bound_order, 1u);
  EXPECT_FALSE(check.num_runs_at_best.has_value());
}

TEST(CheckRequirement, IsUndecidedWithOneRunLess) {
  const RequirementCheck check = fixed_check(a_c12_99_95, errors_with(298, 0), 0);
  EXPECT_EQ(check.verdict, RequirementVerdict::undecided);
  EXPECT_EQ(check.bound_order, 0u);
  // The look at 298 had no chance to be met: all of the risk is left, as for 0 runs below.
  EXPECT_EQ(check.num_runs_at_best, 377u);
  EXPECT_EQ(check.num_runs_at_this_rate, 377u);
}

// The bound that decides is one-sided: 1 − 0.05^(1/299) = 0.99691 %, while a two-sided interval of
// 95 % ends at 1.226 %, which is more than the 1 % that are allowed.
TEST(CheckRequirement, GivesTheBoundThatItDecidesBy) {
  const RequirementCheck met = fixed_check(a_c12_99_95, errors_with(299, 0), 0);
  EXPECT_EQ(met.exceedance->lower, 0.0);
  EXPECT_NEAR(met.exceedance->upper, 0.009969146792899267, 1e-14);
  EXPECT_EQ(met.exceedance->confidence, 0.95);
  // scipy.stats.beta.ppf(0.05, 4, 97).
  const RequirementCheck not_met = fixed_check(a_c12_99_95, errors_with(96, 4), 0);
  EXPECT_NEAR(not_met.exceedance->lower, 0.013776, 1e-6);
}

// Whatever is asked, verdict and bounds say the same.
TEST(CheckRequirement, AgreesWithItsBounds) {
  for (const Tolerance tolerance :
       {Tolerance{0.99, 0.95}, Tolerance{0.9, 0.9}, Tolerance{0.6, 0.8}}) {
    for (std::uint64_t num_runs = 1; num_runs < 700; num_runs += 37) {
      for (std::uint64_t num_exceedances = 0; num_exceedances <= num_runs; ++num_exceedances) {
        const RequirementCheck check =
            check_requirement({.tolerance = tolerance},
                              {.num_runs = num_runs, .num_exceedances = num_exceedances}, num_runs);
        // One of one lies on the border, give or take a rounding.
        if (num_runs == 1) continue;
        const double allowed = 1.0 - tolerance.coverage;
        EXPECT_EQ(check.verdict == RequirementVerdict::met, check.exceedance->upper <= allowed)
            << num_exceedances << " of " << num_runs;
        EXPECT_EQ(check.verdict == RequirementVerdict::not_met, check.exceedance->lower >= allowed)
            << num_exceedances << " of " << num_runs;
      }
    }
  }
}

TEST(Exceeds, IsAboutOneParameterOrAll) {
  std::vector<double> objectives(num_parameters);
  objectives.assign(num_parameters, 2.0);
  std::vector<double> errors(num_parameters);
  errors[index(Parameter::k2c)] = -2.0;
  Requirement one{.parameter = index(Parameter::k2c), .limit = 2.0, .tolerance = {0.9, 0.9}};
  const Requirement all{.tolerance = {0.9, 0.9}, .subject = Requirement::Subject::all_objectives};
  EXPECT_TRUE(exceeds(one, errors, objectives));  // On the limit is not below it.
  one.admits_limit = true;
  EXPECT_FALSE(exceeds(one, errors, objectives));
  EXPECT_FALSE(exceeds(all, errors, objectives));  // On the objective holds.
  errors[index(Parameter::k2c)] = 1.9;
  errors[index(Parameter::a_d13)] = -2.1;
  EXPECT_FALSE(exceeds(one, errors, objectives));
  EXPECT_TRUE(exceeds(all, errors, objectives));
}

// A fixed number of 473 runs would do with one exceedance (second order). Here a number of 300 was
// fixed, with which 4.90 % of the risk went: the rest is evidence of 1,043 (README.md).
TEST(CheckRequirement, SaysHowManyRunsItTakesAfterAnExceedance) {
  const RequirementCheck check = fixed_check(a_c12_99_95, errors_with(299, 1), 0);
  EXPECT_EQ(check.verdict, RequirementVerdict::undecided);
  EXPECT_EQ(check.num_exceedances, 1u);  // On the limit exceeds it.
  EXPECT_EQ(check.num_runs_at_best, 1137u);
  EXPECT_EQ(check.num_runs_at_this_rate, 3000u);
  const auto one_of_300 = ExceedanceCount{.num_runs = 300, .num_exceedances = 1};
  EXPECT_EQ(runs_to_meet({0.99, 0.95}, one_of_300, {}), 663u);
  EXPECT_EQ(runs_to_meet({0.99, 0.95}, one_of_300, 473), 473u);
}

// A look before the fixed number may meet it, too: the fewest are those after which decide() says
// so, of which many are tried one after the other.
TEST(CheckRequirement, SaysTheFewestRunsWhileAFixedNumberIsAhead) {
  for (const std::uint64_t num_fixed : {60u, 100u, 1000u}) {
    std::uint64_t least = 10;
    while (decide({0.95, 0.95}, {.num_runs = least}, num_fixed).verdict != RequirementVerdict::met)
      ++least;
    EXPECT_EQ(runs_to_meet({0.95, 0.95}, {.num_runs = 10}, num_fixed), least) << num_fixed;
  }
}

// Two of 100 go on as often: there is no exceedance, nor a part of one, before the last run.
TEST(CheckRequirement, DecidesWithTheRunsThatItSaysIfTheRateStays) {
  const Tolerance tolerance{0.99, 0.95};
  const RequirementCheck check = fixed_check(a_c12_99_95, errors_with(98, 2), 0);
  const std::uint64_t num_then = *check.num_runs_at_this_rate;
  EXPECT_EQ(num_then, 1350u);
  EXPECT_EQ(
      decide(tolerance, {.num_runs = num_then, .num_exceedances = num_then / 50}, 100).verdict,
      RequirementVerdict::not_met);
  EXPECT_EQ(
      decide(tolerance, {.num_runs = num_then, .num_exceedances = num_then / 50 - 1}, 100).verdict,
      RequirementVerdict::undecided);
}

// The same for other rates and tolerances, on either side.
TEST(CheckRequirement, FulfilsWhatItForetells) {
  for (const Tolerance tolerance : {Tolerance{0.99, 0.95}, Tolerance{0.9, 0.9}}) {
    const Requirement requirement{index(Parameter::a_c12), 9e-4, tolerance};
    for (std::size_t num_runs = 10; num_runs < 200; num_runs += 13) {
      for (std::size_t num_on_limit = 1; num_on_limit < 8; ++num_on_limit) {
        const auto check =
            fixed_check(requirement, errors_with(num_runs - num_on_limit, num_on_limit), 0);
        if (check.num_runs_at_this_rate.value_or(100'000) >= 100'000) continue;
        const std::size_t num_then = *check.num_runs_at_this_rate;
        const std::size_t num_exceedances = num_then * num_on_limit / num_runs;
        const ExceedanceCount then{.num_runs = num_then, .num_exceedances = num_exceedances};
        EXPECT_NE(check_requirement(requirement, then, num_runs).verdict,
                  RequirementVerdict::undecided)
            << num_on_limit << " of " << num_runs;
      }
    }
  }
}

// P(Bin(100, 0.01) ≥ 3) = 7.9 %, ≥ 4: 1.8 %.
TEST(CheckRequirement, IsNotMetOnceTooManyExceed) {
  EXPECT_EQ(fixed_check(a_c12_99_95, errors_with(97, 3), 0).verdict, RequirementVerdict::undecided);
  EXPECT_EQ(fixed_check(a_c12_99_95, errors_with(96, 4), 0).verdict, RequirementVerdict::not_met);
}

TEST(CheckRequirement, CountsRunsWithoutEstimateAsExceedances) {
  const RequirementCheck check = fixed_check(a_c12_99_95, errors_with(96, 1), 3);
  EXPECT_EQ(check.verdict, RequirementVerdict::not_met);
  EXPECT_EQ(check.num_runs, 100u);
  EXPECT_EQ(check.num_exceedances, 4u);
}

// The verdict and the tolerance bound are two ways to say the same.
TEST(CheckRequirement, IsMetIfAndOnlyIfTheBoundIsBelowTheLimit) {
  const std::vector<double> errors = test::half_normal_column(700, {.seed = 31});
  const double bound = wilks_upper(errors, {0.95, 0.9}, 5).value();
  for (double limit = 1.0; limit < 3.5; limit += 0.01) {
    const Requirement requirement{index(Parameter::k2c), limit, {0.95, 0.9}};
    const RequirementCheck check = fixed_check(requirement, errors, 5);
    EXPECT_EQ(check.verdict == RequirementVerdict::met, bound < limit) << limit;
    EXPECT_EQ(check.verdict == RequirementVerdict::met, check.num_exceedances < check.bound_order)
        << limit;
  }
}

struct PublishedRuns {
  double coverage, confidence;
  std::vector<std::uint64_t> num_runs;  ///< For orders 1, 2, 3 ...
};

// Tables for one-sided limits: [Wilks1941] and its use in reactor safety (59, 93, 124 and on).
TEST(WilksOrder, IsThatOfThePublishedNumbersOfRuns) {
  const std::vector<PublishedRuns> table{
      {0.95, 0.95, {59, 93, 124, 153, 181, 208, 234, 260, 286, 311}},
      {0.95, 0.99, {90, 130, 165, 198, 229}},
      {0.90, 0.95, {29, 46, 61, 76, 89, 103}},
      {0.99, 0.95, {299, 473, 628, 773, 913}},
      {0.99, 0.99, {459, 662, 838}}};
  for (const PublishedRuns& row : table) {
    for (std::size_t i = 0; i < row.num_runs.size(); ++i) {
      const Tolerance tolerance{row.coverage, row.confidence};
      EXPECT_EQ(wilks_order(tolerance, row.num_runs[i]), i + 1) << row.num_runs[i];
      EXPECT_EQ(wilks_order(tolerance, row.num_runs[i] - 1), i) << row.num_runs[i];
    }
  }
}

// A million runs against 99.9 %: 1000 are expected above, less 1.645 deviations of 31.6.
TEST(WilksOrder, OfAMillionRunsIsThatOfTheNormalLaw) {
  EXPECT_NEAR(static_cast<double>(wilks_order({0.999, 0.95}, 1'000'000)), 1000.0 - 52.0, 2.0);
}

TEST(WilksUpper, CountsUnknownValuesAsTheLargest) {
  const std::vector<double> values = test::uniform_column(122, {.seed = 4});
  std::vector<double> with_largest = values;
  with_largest.insert(with_largest.end(), {7.0, 7.0});
  EXPECT_EQ(wilks_upper(values, {0.95, 0.95}, 2), wilks_upper(with_largest, {0.95, 0.95}));
  EXPECT_FALSE(wilks_upper(values, {0.95, 0.95}, 6).has_value());
}

// The third largest of 124 is the bound: with two unknown ones that is the largest of the others,
// with three it is unknown itself.
TEST(WilksUpper, IsEmptyOnceUnknownValuesReachItsOrder) {
  const std::vector<double> values = test::uniform_column(122, {.seed = 5});
  const auto bound = wilks_upper(values, {0.95, 0.95}, 2);
  ASSERT_TRUE(bound.has_value());
  EXPECT_EQ(bound, *std::max_element(values.begin(), values.end()));
  EXPECT_FALSE(wilks_upper(std::span(values).first(121), {0.95, 0.95}, 3).has_value());
}

TEST(Tolerance, RefusesFractionsOutsideTheirRange) {
  EXPECT_EQ(test::message_of<InvalidArgument>([] {
              (void)wilks_order({1.0, 0.95}, 10);
            }),
            "coverage = 1 (must be in (0, 1))");
  EXPECT_EQ(test::message_of<InvalidArgument>([] {
              (void)wilks_order({0.95, 0.0}, 10);
            }),
            "confidence = 0 (must be in (0, 1))");
}

std::string refusal_of_rule(std::string_view text) {
  return test::message_of<ConfigError>([&] { (void)test::parse_stop_rule(text); });
}

TEST(ParseStopRule, ReadsEveryStatistic) {
  const StopRule spread = test::parse_stop_rule("std(a_c13) within 5%");
  EXPECT_EQ(spread.statistic, StopRule::Statistic::standard_deviation);
  EXPECT_EQ(spread.parameter, index(Parameter::a_c13));
  EXPECT_EQ(spread.relative_half_width, 0.05);
  EXPECT_EQ(test::parse_stop_rule(" mean ( k2d )within 0.5 %").statistic,
            StopRule::Statistic::mean);
  const StopRule percentile = test::parse_stop_rule("p95(k2c) within 10%");
  EXPECT_EQ(percentile.statistic, StopRule::Statistic::percentile);
  EXPECT_EQ(percentile.level, 0.95);
}

TEST(ParseStopRule, ReadsARequirement) {
  const StopRule rule = test::parse_stop_rule("a_c12 < 9e-4 for 99% with 95% decided ");
  EXPECT_EQ(rule.statistic, StopRule::Statistic::verdict);
  EXPECT_EQ(rule.requirement.parameter, index(Parameter::a_c12));
  EXPECT_EQ(rule.requirement.limit, 9e-4);
  const StopRule joint = test::parse_stop_rule("all objectives for 95% with 90% decided");
  EXPECT_EQ(joint.requirement.subject, Requirement::Subject::all_objectives);
  const StopRule success = test::parse_stop_rule("all objectives within 2%");
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
  StopRule rule = test::parse_stop_rule("std(a_c13) within 5%");
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
  const StopCheck mean = check_stop_rule(test::parse_stop_rule("mean(k2c) within 9%"), errors);
  EXPECT_EQ(mean.estimate, moments(errors).mean);
  EXPECT_EQ(mean.interval->upper, mean_interval(moments(errors), 0.95)->upper);
  const StopCheck percentile_check =
      check_stop_rule(test::parse_stop_rule("p90(k2c) within 9%"), errors);
  EXPECT_EQ(percentile_check.estimate, percentile(sorted(errors), 0.9));
  EXPECT_EQ(percentile_check.interval->upper,
            percentile_interval(sorted(errors), 0.9, 0.95)->upper);
}

TEST(CheckStopRule, IsNotReachedWithoutAnInterval) {
  const StopRule rule = test::parse_stop_rule("p99(k2c) within 50%");
  const StopCheck check = check_stop_rule(rule, test::half_normal_column(100, {.seed = 63}));
  EXPECT_FALSE(check.is_reached);
  EXPECT_FALSE(check.relative_half_width.has_value());
  EXPECT_FALSE(check_stop_rule(rule, std::span<const double>()).is_reached);
  // Equal values are no sign that rare ones are not different.
  EXPECT_FALSE(check_stop_rule(rule, std::vector<double>(1000, 0.5)).is_reached);
}

// Errors of a lognormal law with σ = 2: 192 of them lack the large ones that make its mean, e², as
// often as not, and the interval is then narrow below it.
TEST(CheckStopRule, IsNotReachedByErrorsThatAreTooSkewed) {
  const std::vector<double> errors = test::column_of(
      192, {.seed = 64}, [](double u) { return std::exp(2.0 * inverse_normal(u)); });
  for (const char* const rule : {"mean(k2c) within 99%", "std(k2c) within 99%"}) {
    const StopCheck check = check_stop_rule(test::parse_stop_rule(rule), errors);
    EXPECT_TRUE(check.is_too_skewed);
    EXPECT_LT(*check.relative_half_width, 0.99);
    EXPECT_FALSE(check.is_reached);
  }
  EXPECT_TRUE(check_stop_rule(test::parse_stop_rule("p50(k2c) within 99%"), errors).is_reached);
}

// Half of 128 runs have no error at all; whether the median of all is 0 is open.
TEST(CheckStopRule, IsNotReachedByAnIntervalAboutZero) {
  std::vector<double> errors(66, 0.0);
  errors.resize(128, 1.0);
  const StopCheck check = check_stop_rule(test::parse_stop_rule("p50(k2c) within 50%"), errors);
  EXPECT_EQ(check.estimate, 0.0);
  ASSERT_TRUE(check.interval.has_value());
  EXPECT_GT(check.interval->upper, 0.0);
  EXPECT_FALSE(check.relative_half_width.has_value());
  EXPECT_FALSE(check.is_reached);
}

// 97 of 100: 91.48 to 99.38 % (scipy.stats.beta.ppf), half of which is 4.07 % of 97 %.
TEST(CheckStopRule, KnowsHowOftenAllObjectivesHold) {
  const ExceedanceCount count{.num_runs = 100, .num_exceedances = 3};
  const StopCheck check =
      check_stop_rule(test::parse_stop_rule("all objectives within 4%"), count, {});
  EXPECT_EQ(check.estimate, 0.97);
  EXPECT_NEAR(check.interval->lower, 0.91482394702572, 1e-13);
  EXPECT_NEAR(check.interval->upper, 0.9937700284616936, 1e-13);
  EXPECT_NEAR(*check.relative_half_width, 0.0407, 1e-4);
  EXPECT_FALSE(check.is_reached);
  EXPECT_TRUE(
      check_stop_rule(test::parse_stop_rule("all objectives within 4.1%"), count, {}).is_reached);
}

TEST(CheckStopRule, IsReachedWhenARequirementIsDecided) {
  const StopRule rule = test::parse_stop_rule("a_c12 < 9e-4 for 99% with 95% decided");
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

}  // namespace
}  // namespace proofmass
