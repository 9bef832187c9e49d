#include "worker/net/held_runs.hpp"

#include <gtest/gtest.h>

namespace proofmass::worker {
namespace {

TEST(HeldRuns, AreGroupedByCampaignAndAttempt) {
  const std::vector<HeldRun> runs{{{2}, {1}, {5}}, {{1}, {2}, {7}}, {{1}, {1}, {8}},
                                  {{1}, {1}, {6}}, {{1}, {1}, {7}}, {{1}, {1}, {3}}};
  const std::vector<wire::HeldRuns> expected{
      {{1}, {1}, {{{3}, 1}, {{6}, 3}}}, {{1}, {2}, {{{7}, 1}}}, {{2}, {1}, {{{5}, 1}}}};
  EXPECT_EQ(grouped(runs, 10), expected);
  EXPECT_TRUE(grouped({}, 10).empty());
}

TEST(HeldRuns, AreCutToTheRangesThatAMessageMayHave) {
  const std::vector<HeldRun> runs{
      {{1}, {1}, {0}}, {{1}, {1}, {1}}, {{1}, {1}, {5}}, {{1}, {2}, {7}}, {{1}, {2}, {8}}};
  const std::vector<wire::HeldRuns> two{{{1}, {1}, {{{0}, 2}, {{5}, 1}}}};
  EXPECT_EQ(grouped(runs, 2), two);
  const std::vector<wire::HeldRuns> three{{{1}, {1}, {{{0}, 2}, {{5}, 1}}}, {{1}, {2}, {{{7}, 2}}}};
  EXPECT_EQ(grouped(runs, 3), three);
}

}  // namespace
}  // namespace proofmass::worker
