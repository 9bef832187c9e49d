#include "worker/execution/run_queue.hpp"

#include <gtest/gtest.h>

#include <array>

namespace proofmass::worker {
namespace {

using Indices = std::vector<std::uint64_t>;

wire::RunLease lease(std::uint64_t campaign, std::uint64_t first, std::uint64_t count) {
  return {.campaign = {campaign}, .runs = {{first}, count}, .attempt = {1}, .table_values = {}};
}

wire::RunLease alone(std::uint64_t campaign, std::uint64_t run) {
  wire::RunLease suspect = lease(campaign, run, 1);
  suspect.is_alone = true;
  return suspect;
}

bool always(wire::CampaignId) { return true; }

Indices indices(const Assignment& assignment) {
  Indices runs;
  for (const RunRequest& request : assignment.requests) runs.push_back(request.run.value);
  return runs;
}

TEST(RunQueue, HandsOutRunsAcrossLeasesInTheOrderInWhichTheyCame) {
  RunQueue queue;
  queue.add(lease(1, 10, 3));
  queue.add(lease(1, 40, 1));
  queue.add(lease(1, 5, 2));
  EXPECT_EQ(indices(queue.take(5, always)), (Indices{10, 11, 12, 40, 5}));
  EXPECT_EQ(indices(queue.take(16, always)), Indices{6});
  EXPECT_TRUE(queue.take(16, always).requests.empty());
}

TEST(RunQueue, PutsRunsOfOneCampaignTogether) {
  RunQueue queue;
  queue.add(lease(1, 0, 2));
  queue.add(lease(2, 0, 2));
  queue.add(lease(1, 7, 1));
  const Assignment first = queue.take(4, always);
  EXPECT_EQ(first.campaign, wire::CampaignId{1});
  EXPECT_EQ(indices(first), (Indices{0, 1, 7}));
  EXPECT_EQ(queue.take(4, always).campaign, wire::CampaignId{2});
}

TEST(RunQueue, PassesOverACampaignThatIsNotReady) {
  RunQueue queue;
  queue.add(lease(1, 0, 2));
  queue.add(lease(2, 5, 1));
  const auto is_ready = [](wire::CampaignId campaign) { return campaign.value == 2; };
  EXPECT_EQ(queue.take(4, is_ready).campaign, wire::CampaignId{2});
  EXPECT_TRUE(queue.take(4, is_ready).requests.empty());
  EXPECT_EQ(queue.first_campaign(always), wire::CampaignId{1});
  EXPECT_EQ(queue.first_campaign(is_ready), wire::CampaignId{});
}

// First in the queue, in the middle, and two of them in a row.
TEST(RunQueue, LeavesARunThatIsToBeAloneAlone) {
  RunQueue queue;
  queue.add(alone(1, 9));
  queue.add(lease(1, 0, 2));
  queue.add(alone(1, 5));
  queue.add(alone(1, 6));
  queue.add(lease(1, 2, 1));
  EXPECT_EQ(indices(queue.take(16, always)), Indices{9});
  EXPECT_EQ(indices(queue.take(16, always)), (Indices{0, 1, 2}));
  EXPECT_EQ(indices(queue.take(16, always)), Indices{5});
  EXPECT_EQ(indices(queue.take(16, always)), Indices{6});
}

TEST(RunQueue, MakesSmallerBatchesOfALeaseThatWantsThem) {
  RunQueue queue;
  wire::RunLease last = lease(1, 0, 5);
  last.batch_runs_max = 2;
  queue.add(last);
  queue.add(lease(1, 7, 6));
  EXPECT_EQ(indices(queue.take(4, always)), (Indices{0, 1}));
  EXPECT_EQ(indices(queue.take(1, always)), Indices{2});
  EXPECT_EQ(indices(queue.take(4, always)), (Indices{3, 4}));
  EXPECT_EQ(indices(queue.take(4, always)), (Indices{7, 8, 9, 10}));
  queue.add(last);
  EXPECT_EQ(indices(queue.take(4, always)), (Indices{11, 12, 0, 1})) << "as the first run's lease";
}

TEST(RunQueue, MakesNoLargerBatchesThanTheWorkerCanWhateverALeaseWants) {
  RunQueue queue;
  wire::RunLease hostile = lease(1, 0, 5);
  hostile.batch_runs_max = 0xffffffff;
  queue.add(hostile);
  EXPECT_EQ(indices(queue.take(4, always)), (Indices{0, 1, 2, 3}));
}

TEST(RunQueue, HandsEachRunItsTableValues) {
  RunQueue queue;
  wire::RunLease two = lease(1, 0, 2);
  two.table_values = {1.5, -1.0, 2.5, -2.0};
  queue.add(two);
  const Assignment assignment = queue.take(3, always);
  EXPECT_EQ(assignment.requests[0].table_values, (std::vector<double>{1.5, -1.0}));
  EXPECT_EQ(assignment.requests[1].table_values, (std::vector<double>{2.5, -2.0}));
}

TEST(RunQueue, DropsWhatIsHereOfTheRangesOfACampaign) {
  RunQueue queue;
  queue.add(lease(1, 5, 5));
  queue.add(lease(1, 0, 2));
  queue.add(lease(2, 0, 10));
  (void)queue.take(2, always);
  const std::vector<RunIndex> dropped =
      queue.drop({1}, std::array{RunRange{{0}, 1}, RunRange{{4}, 5}});
  EXPECT_EQ(dropped, (std::vector<RunIndex>{{0}, {7}, {8}}));
  EXPECT_EQ(indices(queue.take(16, always)), (Indices{9, 1}));
  EXPECT_EQ(indices(queue.take(16, always)).size(), 10U);
}

TEST(RunQueue, DropsACampaign) {
  RunQueue queue;
  queue.add(lease(1, 0, 3));
  queue.add(lease(2, 7, 1));
  queue.drop({1});
  EXPECT_FALSE(queue.has({1}));
  EXPECT_TRUE(queue.has({2}));
  EXPECT_EQ(indices(queue.take(16, always)), Indices{7});
}

}  // namespace
}  // namespace proofmass::worker
