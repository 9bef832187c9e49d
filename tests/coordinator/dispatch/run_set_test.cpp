#include "coordinator/dispatch/run_set.hpp"

#include "tests/test.hpp"

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
  EXPECT_EQ(runs.take_first(10), RunSet(range(0, 10)));
  EXPECT_EQ(runs.ranges().size(), 1U);
}

TEST(RunSet, IsWrittenAsItsFirstRanges) {
  RunSet runs;
  EXPECT_EQ(to_text(runs), "none");
  for (std::uint64_t i = 0; i < 8; ++i) runs.add(range(10 * i, 1 + i % 2));
  EXPECT_EQ(to_text(runs), "0,10..11,20,30..31,40,50..51,...");
}

TEST(RunSet, GivesItsLastRuns) {
  RunSet runs;
  runs.add(range(0, 3));
  runs.add(range(10, 2));
  EXPECT_EQ(runs.take_last(3).ranges(), (std::vector{range(2, 1), range(10, 2)}));
  EXPECT_EQ(runs.ranges(), std::vector{range(0, 2)});
}

TEST(RunSet, OverlapsAndDifferencesAreThoseOfSets) {
  std::mt19937 random(11);
  for (int repetition = 0; repetition < 2000; ++repetition) {
    RunSet a;
    RunSet b;
    std::set<std::uint64_t> in_a;
    std::set<std::uint64_t> in_b;
    for (int i = 0; i < 6; ++i) {
      const RunRange of_a = range(random() % 40, random() % 6);
      const RunRange of_b = range(random() % 40, random() % 6);
      a.add(of_a);
      b.add(of_b);
      for (std::uint64_t run = of_a.first.value; run < of_a.end(); ++run) in_a.insert(run);
      for (std::uint64_t run = of_b.first.value; run < of_b.end(); ++run) in_b.insert(run);
    }
    const RunSet common = a.overlap(b);
    RunSet difference = a;
    difference.remove(b);
    ASSERT_EQ(common.size() + difference.size(), a.size());
    for (std::uint64_t run = 0; run < 50; ++run) {
      ASSERT_EQ(common.contains({run}), in_a.contains(run) && in_b.contains(run));
      ASSERT_EQ(difference.contains({run}), in_a.contains(run) && !in_b.contains(run));
    }
  }
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
      ASSERT_EQ(runs.remove(RunIndex{first}), expected.erase(first) == 1);
    }
    ASSERT_EQ(runs.size(), expected.size());
    ASSERT_EQ(runs.empty(), expected.empty());
    const std::uint64_t probe = random() % 70;
    ASSERT_EQ(runs.contains({probe}), expected.contains(probe));
  }
}

TEST(LeaseIndex, RemovesARangeAcrossLeases) {
  LeaseIndex index;
  index.add({{0}, 5}, LeaseId{1});
  index.add({{5}, 5}, LeaseId{2});
  index.remove({{3}, 4});
  EXPECT_EQ(index.runs().ranges(), (std::vector<RunRange>{{{0}, 3}, {{7}, 3}}));
  EXPECT_EQ(index.find({7}), LeaseId{2});
}

TEST(LeaseIndexDeathTest, ARunHasOneLeaseOnly) {
  LeaseIndex index;
  index.add({{2}, 5}, LeaseId{1});
  EXPECT_DEATH(index.add({{6}, 5}, LeaseId{2}), "");
  EXPECT_DEATH(index.add({{0}, 3}, LeaseId{2}), "");
  EXPECT_DEATH(index.remove({{6}, 2}), "");
}

// Against std::map, which is too large for a campaign but obvious.
TEST(LeaseIndex, AgreesWithAMapOfNumbers) {
  std::mt19937 random(5);
  LeaseIndex index;
  std::map<std::uint64_t, std::uint64_t> expected;
  for (int step = 0; step < 20000; ++step) {
    const std::uint64_t run = random() % 60;
    const auto found = expected.find(run);
    if (found == expected.end()) {
      const std::uint64_t lease = 1 + random() % 5;
      index.add({{run}, 1}, LeaseId{lease});
      expected[run] = lease;
    } else {
      index.remove({{run}, 1});
      expected.erase(found);
    }
    ASSERT_EQ(index.runs().size(), expected.size());
    const std::uint64_t probe = random() % 60;
    const auto lease = index.find({probe});
    ASSERT_EQ(lease.has_value(), expected.contains(probe));
    if (lease) {
      ASSERT_EQ(lease->value, expected.at(probe));
    }
  }
}

}  // namespace
}  // namespace proofmass::coordinator
