#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "coordinator/report/verification_matrix.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

/// What is said of so many runs, so many of them at 1e-3 and the others at 1e-4.
std::string answer_to(const std::string& text, std::size_t num_runs, std::size_t num_beyond) {
  RequirementAnswer answer;
  answer.stated.requirement = text;
  answer.requirement = parse_requirement(text);
  answer.check = check_requirement(answer.requirement,
                                   {.num_runs = num_runs, .num_exceedances = num_beyond}, num_runs);
  if (answer.check.bound_order > 0) {
    answer.bound = answer.check.bound_order <= num_beyond ? 1e-3 : 1e-4;
  }
  return requirement_text(answer);
}

// [Wilks1941]: 299 runs for 99 % with 95 %. Clopper and Pearson, one-sided: 1 - 0.05^(1/299).
TEST(RequirementText, SaysThatItIsMet) {
  EXPECT_EQ(answer_to("a_c12 < 9e-4 for 99% with 95%", 299, 0),
            "Requirement  a_c12 < 9e-4 for 99% with 95%\n"
            "Answer       met\n"
            "Rule         299 draws, a number fixed before the first result\n"
            "Exceeding    0 of 299 runs; at most 0.9969 % of all draws, with 95 %\n"
            "Allowed      1 % of all draws\n"
            "Bound        99 % of all draws below 0.0001 rad, with 95 %\n");
}

TEST(RequirementText, SaysHowManyDrawsItTakes) {
  const std::string text = answer_to("a_c12 < 9e-4 for 99% with 95%", 100, 0);
  EXPECT_THAT(text, testing::HasSubstr("Answer       undecided\n"));
  EXPECT_THAT(text, testing::HasSubstr("Bound        none of so few draws, for 99 % with 95 %\n"));
  EXPECT_THAT(text, testing::HasSubstr("Draws        377 meet the requirement if no further one "
                                       "exceeds the limit,\n"
                                       "             377 decide if they go on to exceed it as "
                                       "often\n"));
}

TEST(RequirementText, BreaksALineOfManyRuns) {
  EXPECT_THAT(answer_to("a_c12 < 9e-4 for 9% with 95%", 1'000'000, 909'905),
              testing::HasSubstr("Exceeding    909905 of 1000000 runs;\n             at least "
                                 "90.94 % and at most 91.04 % of all draws, each with 95 %\n"));
}

// One in a hundred, as often as allowed: with 663 draws one may exceed it (sequential).
TEST(RequirementText, SaysThatNoNumberOfDrawsDecides) {
  EXPECT_THAT(answer_to("a_c12 < 9e-4 for 99% with 95%", 100, 1),
              testing::HasSubstr("Draws        663 meet the requirement if no further one "
                                 "exceeds the limit,\n"
                                 "             none decide if"));
}

// scipy.stats.beta.ppf(0.05, 20, 81) = 13.67 %.
TEST(RequirementText, SaysThatItIsNotMet) {
  const std::string text = answer_to("a_c12 < 9e-4 for 99% with 95%", 100, 20);
  EXPECT_THAT(text, testing::HasSubstr("; at least 13.67 % of all draws, with 95 %\n"));
  EXPECT_THAT(text, testing::HasSubstr("Answer       not met\n"));
  EXPECT_THAT(text, testing::Not(testing::HasSubstr("Draws")));
}

// With five unknown draws the sixth largest error is the first that can be a bound.
TEST(RequirementText, SaysHowManyDrawsExceedForWantOfAnEstimate) {
  RequirementAnswer answer;
  answer.requirement = parse_requirement("a_c12 < 9e-4 for 99% with 95%");
  answer.check = check_requirement(
      answer.requirement, {.num_runs = 400, .num_exceedances = 5, .num_without_estimate = 5}, 400);
  answer.missing = {.num_not_finite = 1, .num_no_draw = 4};
  const std::string text = requirement_text(answer);
  EXPECT_THAT(text, testing::HasSubstr("Exceeding    5 of 400 runs;\n"));
  EXPECT_THAT(text, testing::HasSubstr("\n             5 of them for want of an estimate:\n"
                                       "             1 not finite, 4 without draw\n"));
  EXPECT_THAT(text, testing::HasSubstr("Bound        none of so few draws, "));
}

// A bound that rounds to what is allowed has the digits that tell it apart: 1 − 0.05^(1/299) is
// 0.99691 %, of which 0.9969 % are allowed.
TEST(RequirementText, ShowsOnWhichSideABoundLies) {
  EXPECT_THAT(answer_to("a_c12 < 9e-4 for 99.0031% with 95%", 299, 0),
              testing::HasSubstr("at least 0 % and at most 0.99691 % of all draws, each with"));
}

// scipy.stats.beta.ppf: 0.1 with 97 and 4 is 93.44 %, 0.9 with 98 and 3 is 98.89 %.
TEST(RequirementText, TellsOfAllObjectives) {
  const Requirement requirement = parse_requirement("all objectives for 95% with 90%");
  const auto answer_to_count = [&](std::uint64_t num_exceedances, double coverage) {
    RequirementAnswer answer;
    answer.stated.requirement = "all objectives for 95% with 90%";
    answer.requirement = requirement;
    answer.requirement.tolerance.coverage = coverage;
    answer.check = check_requirement(answer.requirement,
                                     {.num_runs = 100, .num_exceedances = num_exceedances}, 100);
    return requirement_text(answer);
  };
  EXPECT_THAT(answer_to_count(3, 0.95),
              testing::StartsWith("Requirement  all objectives for 95% with 90%\n"
                                  "Answer       undecided\n"
                                  "Rule         100 draws, a number fixed before the first result\n"
                                  "Holding      97 of 100 runs;\n"
                                  "             at least 93.44 % and at most 98.89 % of all draws, "
                                  "each with 90 %\n"
                                  "Required     95 % of all draws\n"
                                  "Draws        "));
  EXPECT_THAT(
      answer_to_count(3, 0.95),
      testing::HasSubstr(" meet the requirement if no further one exceeds an objective,\n"));
  EXPECT_THAT(answer_to_count(3, 0.95),
              testing::EndsWith(" decide if they go on to exceed one as often\n"));
  EXPECT_THAT(answer_to_count(3, 0.90),
              testing::HasSubstr("Answer       met\n"
                                 "Rule         100 draws, a number fixed before the first result\n"
                                 "Holding      97 of 100 runs; at least 93.44 % of all draws, with "
                                 "90 %\n"));
  EXPECT_THAT(answer_to_count(3, 0.99),
              testing::HasSubstr("Answer       not met\n"
                                 "Rule         100 draws, a number fixed before the first result\n"
                                 "Holding      97 of 100 runs; at most 98.89 % of all draws, with "
                                 "90 %\n"));
}

TEST(RequirementText, LeavesOutTheUnitOfAPureNumber) {
  EXPECT_THAT(answer_to("a_d11_prime < 9e-4 for 95% with 95%", 59, 0),
              testing::HasSubstr(" below 0.0001, with 95 %\n"));
}

using StoredRequirement = test::StoreTest;

TEST_F(StoredRequirement, CountsRunsWithoutAnEstimateAsExceeding) {
  Store store = Store::create(file(), test::campaign_of(12), "");
  std::vector<Delivery> deliveries = test::deliveries_of(0, 10);
  deliveries[4].result.status = RunStatus::no_draw;
  store.commit(deliveries);
  const Entry given_up = GivenUpRun{.run = {11}};
  store.write({&given_up, 1});
  const std::vector<std::string> texts{"k2c < 1e9 for 50% with 50%"};

  const auto answers =
      check_requirements(store, MicroscopeCampaign{}.objectives(), numbered_requirements(texts));

  ASSERT_EQ(answers.size(), 1U);
  EXPECT_EQ(answers[0].check.num_runs, 11U);
  EXPECT_EQ(answers[0].check.num_exceedances, 2U);
  EXPECT_EQ(answers[0].missing, (MissingEstimates{.num_no_draw = 1, .num_given_up = 1}));
}

// Seven of ten runs meet every objective: one lacks an estimate, one is beyond an objective, and
// another beyond two of them.
TEST_F(StoredRequirement, CountsRunsThatMissAnyObjectiveOnce) {
  Store store = Store::create(file(), test::campaign_of(10), "");
  std::vector<Delivery> deliveries = test::deliveries_of(0, 10);
  for (Delivery& delivery : deliveries) delivery.result.estimate = delivery.result.truth;
  deliveries[4].result.status = RunStatus::no_draw;
  const std::vector<double> objectives = MicroscopeCampaign{}.objectives();
  const auto miss = [&](std::size_t run, Parameter parameter) {
    deliveries[run].result.estimate[index(parameter)] -= 2.0 * objectives[index(parameter)];
  };
  miss(2, Parameter::a_c12);
  miss(7, Parameter::k2c);
  miss(7, Parameter::a_c13);
  store.commit(deliveries);
  const std::vector<std::string> texts{"all objectives for 50% with 50%"};
  const RequirementCheck check =
      check_requirements(store, objectives, numbered_requirements(texts))[0].check;
  EXPECT_EQ(check.num_runs, 10U);
  EXPECT_EQ(check.num_exceedances, 3U);
  EXPECT_EQ(check.num_without_estimate, 1U);
}

TEST_F(StoredRequirement, IsOfErrorsOfEitherSign) {
  Store store = Store::create(file(), test::campaign_of(10), "");
  std::vector<Delivery> deliveries = test::deliveries_of(0, 10);
  for (Delivery& delivery : deliveries) {
    delivery.result.truth.assign(num_parameters, 0.0);
    delivery.result.estimate.assign(num_parameters, delivery.result.run.value < 4 ? -2.0 : 0.5);
  }
  store.commit(deliveries);
  const std::vector<std::string> texts{"k2c < 1 for 50% with 50%"};
  EXPECT_EQ(
      check_requirements(store, MicroscopeCampaign{}.objectives(), numbered_requirements(texts))[0]
          .check.num_exceedances,
      4U);
}

// 64 runs without an exceedance are enough for 95 % with 95 % if their number was fixed (59), and
// too few for a rule that lets one look and go on (79): see decide().
TEST_F(StoredRequirement, IsOfAFixedSizeUntilTheCampaignIsExtended) {
  const std::vector<std::string> texts{"k2c < 1e9 for 95% with 95%"};
  const auto answer = [&](const Store& store) {
    return check_requirements(store, MicroscopeCampaign{}.objectives(),
                              numbered_requirements(texts))[0];
  };
  Store store = Store::create(file(), test::campaign_of(60), "");
  EXPECT_EQ(store.num_runs_fixed(), 60U);
  store.extend(test::campaign_of(64), "");  // Nobody can have seen a result.
  EXPECT_EQ(store.num_runs_fixed(), 64U);
  store.commit(test::deliveries_of(0, 63));
  EXPECT_FALSE(answer(store).check.is_of_fixed_size);  // It may yet be stopped.
  EXPECT_EQ(answer(store).check.verdict, RequirementVerdict::undecided);
  EXPECT_EQ(answer(store).check.num_runs_at_best, 64U);
  store.commit(test::deliveries_of(63, 64));
  EXPECT_TRUE(answer(store).check.is_of_fixed_size);
  EXPECT_EQ(answer(store).check.verdict, RequirementVerdict::met);
  store.extend(test::campaign_of(70), "");
  store.commit(test::deliveries_of(64, 70));
  EXPECT_EQ(store.num_runs_fixed(), 64U);
  EXPECT_FALSE(answer(store).check.is_of_fixed_size);
  EXPECT_EQ(answer(store).check.verdict, RequirementVerdict::undecided);
  EXPECT_THAT(requirement_text(answer(store)),
              testing::HasSubstr("Rule         sequential: holds however often one looks and "
                                 "goes on\n"));
}

TEST_F(StoredRequirement, IsSequentialWithAStopRule) {
  Store store = Store::create(file(), test::campaign_of(60), "");
  store.set_stop_plan({.stop_rule = "std(k2c) within 5%", .num_runs_max = 60, .failures_max = {}});
  EXPECT_FALSE(store.num_runs_fixed().has_value());
  store.set_stop_plan({});
  EXPECT_EQ(store.num_runs_fixed(), 60U);
  store.commit(test::deliveries_of(0, 60));
  store.set_stop_plan({.stop_rule = "std(k2c) within 5%", .num_runs_max = 60, .failures_max = {}});
  EXPECT_EQ(store.num_runs_fixed(), 60U);
}

}  // namespace
}  // namespace proofmass::coordinator
