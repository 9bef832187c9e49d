#include <gtest/gtest.h>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/store.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using test::campaign_of;

class StoreStop : public test::StoreTest {
 protected:
  void SetUp() override { create(10); }
};

TEST_F(StoreStop, PlanIsKept) {
  EXPECT_EQ(Store::open_read_only(file()).stop_plan(), StopPlan{});
  const StopPlan plan{.stop_rule = "std(a_c13) within 5%", .num_runs_max = 5000, .failures_max = 0};
  Store::open(file()).set_stop_plan(plan);
  EXPECT_EQ(Store::open_read_only(file()).stop_plan(), plan);
  Store::open(file()).set_stop_plan({});
  EXPECT_EQ(Store::open_read_only(file()).stop_plan(), StopPlan{});
}

// Also if the process ends in between.
TEST_F(StoreStop, PlanThatIsNewLeavesAFinishedCampaignActiveUntilItsRuleIsChecked) {
  Store store = Store::open(file());
  const Entry finished = CampaignControl{.phase = wire::CampaignPhase::finished};
  (void)store.write({&finished, 1});
  store.set_stop_plan({.stop_rule = "", .num_runs_max = {}, .failures_max = 3});
  EXPECT_EQ(store.control().phase, wire::CampaignPhase::finished) << "no rule";
  const StopPlan plan{.stop_rule = "std(a_c13) within 5%", .num_runs_max = 50, .failures_max = {}};
  store.set_stop_plan(plan);
  EXPECT_EQ(store.control().phase, wire::CampaignPhase::active);
  (void)store.write({&finished, 1});
  store.set_stop_plan(plan);
  EXPECT_EQ(store.control().phase, wire::CampaignPhase::finished) << "the same plan";
}

TEST_F(StoreStop, ChecksAreKeptOnceForEachCount) {
  Store store = Store::open(file());
  store.record_stop_check(128, "std(a_c13)", {});
  store.record_stop_check(192, "std(a_c13)",
                          {.is_reached = true,
                           .estimate = 0.5,
                           .interval = Interval{.lower = 0.25, .upper = 0.75, .confidence = 0.95},
                           .relative_half_width = 0.125});
  StopCheck again;
  again.estimate = 2.0;
  store.record_stop_check(128, "std(a_c13)", again);
  const Database database(file(), Access::read_only);
  EXPECT_EQ(
      database.text("SELECT group_concat(num_runs || ' ' || statistic || ' ' || estimate || ' ' || "
                    "coalesce(lower, '-') || ' ' || coalesce(upper, '-') || ' ' || "
                    "coalesce(relative_half_width, '-') || ' ' || is_reached, ';') "
                    "FROM stop_check"),
      "128 std(a_c13) 2.0 - - - 0;192 std(a_c13) 0.5 0.25 0.75 0.125 1");
}

}  // namespace
}  // namespace proofmass::coordinator
