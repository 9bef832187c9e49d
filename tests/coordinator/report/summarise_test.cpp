#include "coordinator/report/summarise.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

class Summarise : public test::StoreTest {
 protected:
  /// A finished campaign with this plan, whose errors have these magnitudes in turn and alternate
  /// in sign; run 3 is without an estimate.
  Store finished(std::uint64_t num_runs, const StopPlan& plan, double even, double odd) {
    Store store = Store::create(file(), test::campaign_of(num_runs), "");
    store.set_stop_plan(plan);
    std::vector<Delivery> deliveries = test::deliveries_of(0, num_runs);
    for (Delivery& delivery : deliveries) {
      delivery.result.truth.assign(num_parameters, 0.0);
      delivery.result.estimate.assign(num_parameters,
                                      delivery.result.run.value % 2 == 0 ? even : -odd);
    }
    deliveries[3].result.status = RunStatus::no_draw;
    store.commit(deliveries);
    return store;
  }

  std::optional<std::uint64_t> next_runs(Store& store) {
    return summarise_file(file(), MicroscopeCampaign{},
                          [&](const std::function<void(Store&)>& action) { action(store); });
  }

  static StopPlan plan_of(std::uint64_t num_runs_max) {
    return {.stop_rule = "mean(k2c) within 5%", .num_runs_max = num_runs_max, .failures_max = {}};
  }
};

// Magnitudes 1 and 1.01 have a mean within 0.1 %; the mean of the errors themselves is near 0.
TEST_F(Summarise, EndsOnceTheMagnitudesAreKnownWellEnough) {
  Store store = finished(128, plan_of(1000), 1.0, 1.01);
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_FALSE(is_rule_missed(store));
}

// Magnitudes 1 and 3: a mean of 2 ± 1.98/√127, which is 9 %.
TEST_F(Summarise, AsksForTheRunsOfTheNextCheck) {
  Store store = finished(128, plan_of(1000), 1.0, 3.0);
  EXPECT_EQ(next_runs(store), 192U);
  EXPECT_TRUE(is_rule_missed(store));
}

// 64 magnitudes of 1 and 63 of 3 have a mean within 8.8496 % (scipy).
TEST_F(Summarise, TellsWhatTheRuleAskedForAndWhatItFound) {
  Store store = finished(128, plan_of(1000), 1.0, 3.0);
  EXPECT_EQ(stop_text(store), "") << "not checked yet";
  (void)next_runs(store);
  EXPECT_EQ(stop_text(store),
            "Stopping  mean(k2c) within 8.85 %, half its 95 % interval\n"
            "          after 128 runs; mean(k2c) within 5%: not reached\n");
}

// All magnitudes are 1 but for run 3, which has no estimate: one of 128 exceeds. The bound is the
// sequential one, 5.0833 % (scipy.optimize.brentq of the evidence).
TEST_F(Summarise, DecidesARequirement) {
  const std::string rule = "k2c < 2 for 90% with 95% decided";
  Store store = finished(128, {.stop_rule = rule, .num_runs_max = 1000, .failures_max = {}}, 1, 1);
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_FALSE(is_rule_missed(store));
  EXPECT_EQ(stop_text(store),
            "Stopping  k2c < 2 for 90% with 95% decided\n"
            "          met after 128 runs; exceeding: 1\n"
            "          at most 5.083 % of all draws, with 95 %\n");
  EXPECT_TRUE(stop_check_differences(store, MicroscopeCampaign{}.objectives()).empty());
}

// The same of all objectives, which hold in all runs but run 3: 1 − 5.0833 %.
TEST_F(Summarise, DecidesARequirementOnAllObjectives) {
  const std::string rule = "all objectives for 90% with 95% decided";
  Store store = finished(128, {.stop_rule = rule, .num_runs_max = 1000, .failures_max = {}}, 0, 0);
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_FALSE(is_rule_missed(store));
  EXPECT_EQ(stop_text(store),
            "Stopping  all objectives for 90% with 95% decided\n"
            "          met after 128 runs; holding: 127\n"
            "          at least 94.92 % of all draws, with 95 %\n");
}

// A requirement that is decided and not met is missed; the campaign ends all the same.
TEST_F(Summarise, EndsWhenARequirementCannotBeMet) {
  const std::string rule = "k2c < 2 for 90% with 95% decided";
  Store store = finished(128, {.stop_rule = rule, .num_runs_max = 1000, .failures_max = {}}, 1, 3);
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_TRUE(is_rule_missed(store));
}

TEST_F(Summarise, GoesOnWhileARequirementIsUndecided) {
  const std::string rule = "k2c < 2 for 99% with 95% decided";
  Store store = finished(128, {.stop_rule = rule, .num_runs_max = 1000, .failures_max = {}}, 1, 1);
  EXPECT_EQ(next_runs(store), 192U);
  EXPECT_TRUE(is_rule_missed(store));
}

// Errors of 1 exceed every objective but those of the quadratic factors.
TEST_F(Summarise, CountsWhereAllObjectivesHold) {
  const StopPlan plan{
      .stop_rule = "all objectives within 50%", .num_runs_max = 1000, .failures_max = {}};
  Store store = finished(128, plan, 0.0, 1.0);
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_EQ(store.stop_checks().back().check.estimate, 0.5);
  EXPECT_EQ(stop_text(store),
            "Stopping  all objectives within 17.9 %, half its 95 % interval\n"
            "          in 64 of 128 runs, 41 to 59 % of all draws\n"
            "          after 128 runs; all objectives within 50%: reached\n");
  EXPECT_TRUE(stop_check_differences(store, MicroscopeCampaign{}.objectives()).empty());
}

TEST_F(Summarise, AsksForNoMoreRunsThanThereMayBe) {
  Store store = finished(128, plan_of(150), 1.0, 3.0);
  EXPECT_EQ(next_runs(store), 150U);
}

TEST_F(Summarise, EndsWithTheLastRunThatThereMayBe) {
  Store store = finished(150, plan_of(150), 1.0, 3.0);
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_TRUE(is_rule_missed(store));
}

// Of the runs that were asked for, whether they have an estimate or not.
TEST_F(Summarise, RecordsAfterHowManyRunsItChecked) {
  Store store = finished(128, plan_of(1000), 1.0, 3.0);
  (void)next_runs(store);
  EXPECT_EQ(store.stop_checks().back().num_runs, 128U);
  EXPECT_EQ(store.summary()->num_finished, 128U);
  EXPECT_EQ(store.summary()->num_estimated, 127U);
}

// Or a program that stops before the check would say that the rule holds.
TEST_F(Summarise, MissesARuleThatWasNotCheckedWithAllRuns) {
  Store store = finished(128, plan_of(1000), 1.0, 1.01);
  EXPECT_TRUE(lacks_stop_check(store));
  EXPECT_TRUE(is_rule_missed(store));
  (void)next_runs(store);
  EXPECT_FALSE(lacks_stop_check(store));
  EXPECT_FALSE(is_rule_missed(store));
  store.extend(test::campaign_of(192), "");
  EXPECT_TRUE(lacks_stop_check(store));
  EXPECT_TRUE(is_rule_missed(store));
}

TEST_F(Summarise, WithoutARuleStoresStatisticsAlone) {
  Store store = finished(10, {}, 1.0, 3.0);
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_EQ(store.summary()->num_estimated, 9U);
  EXPECT_FALSE(lacks_stop_check(store));
  EXPECT_FALSE(is_rule_missed(store));
}

}  // namespace
}  // namespace proofmass::coordinator
