#include "coordinator/net/timing.hpp"

#include <gtest/gtest.h>

namespace proofmass::coordinator {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

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

TEST(RateMeter, CountsFromItsBeginning) {
  RateMeter meter(start);
  EXPECT_EQ(meter.rate_hz(start), 0.0);
  meter.add(30, start + seconds(5));
  EXPECT_EQ(meter.rate_hz(start + seconds(10)), 3.0);
}

TEST(RateMeter, ForgetsWhatIsOlderThanTwoMinutes) {
  RateMeter meter(start);
  meter.add(1000, start + seconds(1));
  meter.add(240, start + seconds(200));
  EXPECT_EQ(meter.rate_hz(start + seconds(200)), 2.0);
  EXPECT_EQ(meter.rate_hz(start + seconds(400)), 0.0);
}

// Its memory does not grow with the number of commits.
TEST(RateMeter, CountsAllOfASecondTogether) {
  RateMeter meter(start);
  for (int i = 0; i < 1000; ++i) meter.add(2, start + milliseconds(i));
  EXPECT_EQ(meter.rate_hz(start + seconds(10)), 200.0);
}

}  // namespace
}  // namespace proofmass::coordinator
