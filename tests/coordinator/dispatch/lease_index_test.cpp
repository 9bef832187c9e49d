#include "coordinator/dispatch/lease_index.hpp"

#include <gtest/gtest.h>

#include <map>
#include <random>

namespace proofmass::coordinator {
namespace {

TEST(LeaseIndex, FindsTheLeaseOfARun) {
  LeaseIndex index;
  index.add({{0}, 5}, LeaseId{1});
  index.add({{5}, 5}, LeaseId{2});
  EXPECT_EQ(index.find({4}), LeaseId{1});
  EXPECT_EQ(index.find({5}), LeaseId{2});
  EXPECT_EQ(index.find({10}), std::nullopt);
  EXPECT_EQ(index.size(), 10U);
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
    ASSERT_EQ(index.size(), expected.size());
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
