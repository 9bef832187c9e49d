#include "core/runs.hpp"

#include <gtest/gtest.h>

namespace proofmass {
namespace {

TEST(RunRanges, AreTheFewestThatHoldTheRuns) {
  const std::vector<RunIndex> runs{{0}, {1}, {2}, {5}, {9}, {10}};
  const std::vector<RunRange> ranges{{{0}, 3}, {{5}, 1}, {{9}, 2}};
  EXPECT_EQ(ranges_of(runs), ranges);
  EXPECT_EQ(indices_of(ranges), runs);
  EXPECT_TRUE(ranges_of(std::vector<RunIndex>{}).empty());
}

}  // namespace
}  // namespace proofmass
