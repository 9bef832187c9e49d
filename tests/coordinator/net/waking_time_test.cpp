#include "coordinator/net/waking_time.hpp"

#include <gtest/gtest.h>

namespace proofmass::coordinator {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;

constexpr TimePoint start{hours(5)};

TEST(WakingTime, IsThatOfTheClockWhileTheProcessIsAwake) {
  WakingTime time(start);
  EXPECT_EQ(time.at(start), start);
  EXPECT_EQ(time.at(start + milliseconds(100)), start + milliseconds(100));
  EXPECT_EQ(time.at(start + milliseconds(600)), start + milliseconds(600));
}

TEST(WakingTime, LeavesOutWhatIsLongerThanAGap) {
  WakingTime time(start);
  EXPECT_EQ(time.at(start + hours(1)), start + WakingTime::gap_max);
  EXPECT_EQ(time.at(start + hours(1) + milliseconds(100)),
            start + WakingTime::gap_max + milliseconds(100));
  EXPECT_EQ(time.at(start + hours(2)), start + 2 * WakingTime::gap_max + milliseconds(100));
}

}  // namespace
}  // namespace proofmass::coordinator
