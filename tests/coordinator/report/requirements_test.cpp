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

// Bounds of proportions are those of Clopper and Pearson (scipy.stats.beta.ppf): 0.1 with 97 and 4
// is 93.44 %, 0.9 with 98 and 3 is 98.89 %. One in a hundred is as often as allowed: with 663 draws
// one may exceed the limit (sequential), and no number of draws decides. A bound that rounds to
// what is allowed has the digits that tell it apart: 1 − 0.05^(1/299) is 0.99691 %.
TEST(RequirementText, TellsBoundsAndHowManyDrawsDecide) {
  struct Case {
    std::string requirement;
    std::size_t num_runs;
    std::size_t num_beyond;
    std::string part;
  };
  const std::string fixed = "Rule         100 draws, a number fixed before the first result\n";
  const Case cases[] = {
      {"a_c12 < 9e-4 for 9% with 95%", 1'000'000, 909'905,
       "Exceeding    909905 of 1000000 runs;\n             at least 90.94 % and at most 91.04 % of "
       "all draws, each with 95 %\n"},
      {"a_c12 < 9e-4 for 99% with 95%", 100, 1,
       "Draws        663 meet the requirement if no further one exceeds the limit,\n"
       "             none decide if"},
      {"a_c12 < 9e-4 for 99.0031% with 95%", 299, 0,
       "at least 0 % and at most 0.99691 % of all draws, each with"},
      {"a_d11_prime < 9e-4 for 95% with 95%", 59, 0, " below 0.0001, with 95 %\n"},
      {"all objectives for 95% with 90%", 100, 3,
       "Answer       undecided\n" + fixed +
           "Holding      97 of 100 runs;\n             at least 93.44 % and at most 98.89 % of all "
           "draws, each with 90 %\nRequired     95 % of all draws\nDraws        "},
      {"all objectives for 95% with 90%", 100, 3,
       " meet the requirement if no further one exceeds an objective,\n"},
      {"all objectives for 95% with 90%", 100, 3, " decide if they go on to exceed one as often\n"},
      {"all objectives for 90% with 90%", 100, 3,
       "Answer       met\n" + fixed +
           "Holding      97 of 100 runs; at least 93.44 % of all draws, with 90 %\n"}};
  for (const Case& of : cases) {
    EXPECT_THAT(answer_to(of.requirement, of.num_runs, of.num_beyond), testing::HasSubstr(of.part));
  }
}

using StoredRequirement = test::StoreTest;

// Seven of eleven runs meet every objective: one lacks an estimate, one was given up, one is beyond
// an objective, and another beyond two of them.
TEST_F(StoredRequirement, CountsRunsThatMissAnyObjectiveOnce) {
  Store store = Store::create(file(), test::campaign_of(11), "");
  const Entry given_up = GivenUpRun{.run = {10}};
  store.write({&given_up, 1});
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
  const RequirementAnswer answer =
      check_requirements(store, objectives, numbered_requirements(texts))[0];
  EXPECT_EQ(answer.check.num_runs, 11U);
  EXPECT_EQ(answer.check.num_exceedances, 4U);
  EXPECT_EQ(answer.check.num_without_estimate, 2U);
  EXPECT_EQ(answer.missing, (MissingEstimates{.num_no_draw = 1, .num_given_up = 1}));
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
