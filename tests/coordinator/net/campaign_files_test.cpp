#include "coordinator/net/campaign_files.hpp"

#include <gtest/gtest.h>

namespace proofmass::coordinator {
namespace {

StopPlan plan_with_rule() {
  return {.stop_rule = "mean(k2c) within 5%", .num_runs_max = {}, .failures_max = {}};
}

TEST(HorizonOf, WithoutARuleIsWhatIsAskedFor) {
  EXPECT_EQ(horizon_of({}, 1000, 0), 1000U);
  EXPECT_EQ(horizon_of({}, 1000, 10), 1000U);
}

// 128 runs first, then 192 and 256.
TEST(HorizonOf, IsTheNextCheckOfTheRule) {
  EXPECT_EQ(horizon_of(plan_with_rule(), 1000, 0), 128U);
  EXPECT_EQ(horizon_of(plan_with_rule(), 1000, 100), 128U);
  EXPECT_EQ(horizon_of(plan_with_rule(), 1000, 129), 192U);
}

// A file may have been left before the rule was checked.
TEST(HorizonOf, OfARunCountThatIsACheckIsThatCheck) {
  EXPECT_EQ(horizon_of(plan_with_rule(), 1000, 128), 128U);
  EXPECT_EQ(horizon_of(plan_with_rule(), 1000, 192), 192U);
}

TEST(HorizonOf, IsNotBeyondWhatIsAskedFor) {
  EXPECT_EQ(horizon_of(plan_with_rule(), 100, 0), 100U);
  EXPECT_EQ(horizon_of(plan_with_rule(), 150, 140), 150U);
  EXPECT_EQ(horizon_of(plan_with_rule(), 50, 100), 50U);  // Which is refused where it is wanted.
}

}  // namespace
}  // namespace proofmass::coordinator
