#include "coordinator/dispatch/run_set.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>

namespace proofmass::coordinator {
namespace {

RunRange range(std::uint64_t first, std::uint64_t count) { return {{first}, count}; }

TEST(RunSet, JoinsRangesThatTouchOrOverlap) {
  RunSet runs;
  runs.add(range(0, 5));
  runs.add(range(10, 5));
  EXPECT_EQ(runs.ranges(), (std::vector{range(0, 5), range(10, 5)}));
  runs.add(range(4, 6));
  EXPECT_EQ(runs.ranges(), std::vector{range(0, 15)});
  EXPECT_EQ(runs.size(), 15U);
}

TEST(RunSet, HoldsABillionRunsAsOneRange) {
  RunSet runs(range(0, num_runs_max));
  EXPECT_EQ(runs.size(), num_runs_max);
  EXPECT_EQ(runs.ranges().size(), 1U);
  EXPECT_EQ(runs.take_first(10), range(0, 10));
  EXPECT_EQ(runs.ranges().size(), 1U);
}

TEST(RunSet, SplitsARangeAtARunThatIsRemoved) {
  RunSet runs(range(0, 3));
  EXPECT_TRUE(runs.remove({1}));
  EXPECT_FALSE(runs.remove({1}));
  EXPECT_EQ(runs.ranges(), (std::vector{range(0, 1), range(2, 1)}));
  EXPECT_EQ(runs.take_first(5), range(0, 1));
}

TEST(RunSet, IsWrittenAsItsFirstRanges) {
  RunSet runs;
  EXPECT_EQ(to_text(runs), "none");
  for (std::uint64_t i = 0; i < 8; ++i) runs.add(range(10 * i, 1 + i % 2));
  EXPECT_EQ(to_text(runs), "0,10..11,20,30..31,40,50..51,...");
}

// Against std::set, which is too large for a campaign but obvious.
TEST(RunSet, AgreesWithASetOfNumbers) {
  std::mt19937 random(7);
  RunSet runs;
  std::set<std::uint64_t> expected;
  for (int step = 0; step < 20000; ++step) {
    const std::uint64_t first = random() % 60;
    if (random() % 3 == 0) {
      const std::uint64_t count = random() % 6;
      runs.add(range(first, count));
      for (std::uint64_t run = first; run < first + count; ++run) expected.insert(run);
    } else {
      ASSERT_EQ(runs.remove({first}), expected.erase(first) == 1);
    }
    ASSERT_EQ(runs.size(), expected.size());
    ASSERT_EQ(runs.empty(), expected.empty());
    const std::uint64_t probe = random() % 70;
    ASSERT_EQ(runs.contains({probe}), expected.contains(probe));
  }
}

}  // namespace
}  // namespace proofmass::coordinator
