#include "worker/supervision/restart_policy.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "coordinator/dispatch/state.hpp"

namespace proofmass::worker {
namespace {

using namespace std::chrono_literals;
using Time = std::chrono::steady_clock::time_point;

TEST(RestartPolicy, WaitsTwiceAsLongAfterEachCrashUpToHalfAMinute) {
  RestartPolicy policy;
  std::vector<RestartConfig::Duration> delays;
  for (int i = 0; i < 9; ++i) delays.push_back(policy.on_crash(Time{} + i * 30s).value());
  EXPECT_EQ(delays,
            (std::vector<RestartConfig::Duration>{1s, 2s, 4s, 8s, 16s, 30s, 30s, 30s, 30s}));
}

// Later, and the crash counts against nobody; as long again is for the start and the network.
TEST(RestartPolicy, StartsAWorkerBeforeItsCoordinatorTakesItForLost) {
  EXPECT_LE(2 * RestartConfig{}.delay_max, coordinator::DispatchConfig{}.lost_after);
}

TEST(RestartPolicy, GivesUpAtTheTenthCrashWithinTenMinutes) {
  RestartPolicy policy;
  for (int i = 0; i < 9; ++i) EXPECT_TRUE(policy.on_crash(Time{} + i * 60s).has_value());
  EXPECT_FALSE(policy.on_crash(Time{} + 600s).has_value());
}

TEST(RestartPolicy, ForgetsOldCrashes) {
  RestartPolicy policy;
  for (int i = 0; i < 100; ++i) {
    EXPECT_TRUE(policy.on_crash(Time{} + i * 67s).has_value()) << "nine within ten minutes";
  }
  EXPECT_EQ(policy.on_crash(Time{} + 10h), 1s);
}

}  // namespace
}  // namespace proofmass::worker
