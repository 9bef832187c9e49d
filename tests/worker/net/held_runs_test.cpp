#include "worker/net/held_runs.hpp"

#include <gtest/gtest.h>

#include "tests/support/messages.hpp"

namespace proofmass::worker {
namespace {

TEST(HeldRuns, AreGroupedByCampaignAndAttempt) {
  const std::vector<HeldRun> runs{{{2}, {1}, {5}}, {{1}, {2}, {7}}, {{1}, {1}, {8}},
                                  {{1}, {1}, {6}}, {{1}, {1}, {7}}, {{1}, {1}, {3}}};
  const std::vector expected{test::make_held({1}, {1}, {{{3}, 1}, {{6}, 3}}),
                             test::make_held({1}, {2}, {{{7}, 1}}),
                             test::make_held({2}, {1}, {{{5}, 1}})};
  EXPECT_EQ(test::vector_of(grouped(runs, 10)), expected);
  EXPECT_TRUE(grouped({}, 10).empty());
}

TEST(HeldRuns, AreCutToTheRangesThatAMessageMayHave) {
  const std::vector<HeldRun> runs{
      {{1}, {1}, {0}}, {{1}, {1}, {1}}, {{1}, {1}, {5}}, {{1}, {2}, {7}}, {{1}, {2}, {8}}};
  std::vector expected{test::make_held({1}, {1}, {{{0}, 2}, {{5}, 1}})};
  EXPECT_EQ(test::vector_of(grouped(runs, 2)), expected);
  expected.push_back(test::make_held({1}, {2}, {{{7}, 2}}));
  EXPECT_EQ(test::vector_of(grouped(runs, 3)), expected);
}

}  // namespace
}  // namespace proofmass::worker
