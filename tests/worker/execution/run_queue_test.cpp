#include "worker/execution/run_queue.hpp"

#include "tests/support/messages.hpp"
#include "tests/test.hpp"

namespace proofmass::worker {
namespace {

using Indices = std::vector<std::uint64_t>;

proto::RunLease lease(std::uint64_t campaign, std::uint64_t first, std::uint64_t count) {
  return test::make_lease({campaign}, {{first}, count});
}

proto::RunLease alone(std::uint64_t campaign, std::uint64_t run) {
  proto::RunLease suspect = lease(campaign, run, 1);
  suspect.set_is_alone(true);
  return suspect;
}

/// All runs of the lease.
void add(RunQueue& queue, const proto::RunLease& lease) {
  queue.add(lease, std::array{wire::runs_of(lease)});
}

bool all(wire::CampaignId, bool) { return true; }
bool those_for_cards(wire::CampaignId, bool is_for_cards) { return is_for_cards; }
bool those_for_processors(wire::CampaignId, bool is_for_cards) { return !is_for_cards; }

Indices indices(const TakenRuns& assignment) {
  Indices runs;
  for (const RunRequest& request : assignment.requests) runs.push_back(request.run.value);
  return runs;
}

TEST(RunQueue, HandsOutRunsAcrossLeasesInTheOrderInWhichTheyCame) {
  RunQueue queue;
  add(queue, lease(1, 10, 3));
  add(queue, lease(1, 40, 1));
  add(queue, lease(1, 5, 2));
  EXPECT_EQ(indices(queue.take(5, all)), (Indices{10, 11, 12, 40, 5}));
  EXPECT_EQ(indices(queue.take(16, all)), Indices{6});
  EXPECT_TRUE(queue.take(16, all).requests.empty());
}

TEST(RunQueue, PutsRunsOfOneCampaignTogether) {
  RunQueue queue;
  add(queue, lease(1, 0, 2));
  add(queue, lease(2, 0, 2));
  add(queue, lease(1, 7, 1));
  const TakenRuns first = queue.take(4, all);
  EXPECT_EQ(first.campaign, wire::CampaignId{1});
  EXPECT_EQ(indices(first), (Indices{0, 1, 7}));
  EXPECT_EQ(queue.take(4, all).campaign, wire::CampaignId{2});
}

TEST(RunQueue, PassesOverACampaignThatIsNotReady) {
  RunQueue queue;
  add(queue, lease(1, 0, 2));
  add(queue, lease(2, 5, 1));
  const auto is_ready = [](wire::CampaignId campaign, bool) { return campaign.value == 2; };
  EXPECT_EQ(queue.take(4, is_ready).campaign, wire::CampaignId{2});
  EXPECT_TRUE(queue.take(4, is_ready).requests.empty());
  EXPECT_EQ(queue.first_campaign(all), wire::CampaignId{1});
  EXPECT_EQ(queue.first_campaign(is_ready), wire::CampaignId{});
}

// First in the queue, in the middle, and two of them in a row.
TEST(RunQueue, LeavesARunThatIsToBeAloneAlone) {
  RunQueue queue;
  add(queue, alone(1, 9));
  add(queue, lease(1, 0, 2));
  add(queue, alone(1, 5));
  add(queue, alone(1, 6));
  add(queue, lease(1, 2, 1));
  EXPECT_EQ(indices(queue.take(16, all)), Indices{9});
  EXPECT_EQ(indices(queue.take(16, all)), (Indices{0, 1, 2}));
  EXPECT_EQ(indices(queue.take(16, all)), Indices{5});
  EXPECT_EQ(indices(queue.take(16, all)), Indices{6});
}

TEST(RunQueue, MakesSmallerBatchesOfALeaseThatWantsThem) {
  RunQueue queue;
  proto::RunLease last = lease(1, 0, 5);
  last.set_batch_runs_max(2);
  add(queue, last);
  add(queue, lease(1, 7, 6));
  EXPECT_EQ(indices(queue.take(4, all)), (Indices{0, 1}));
  EXPECT_EQ(indices(queue.take(1, all)), Indices{2});
  EXPECT_EQ(indices(queue.take(4, all)), (Indices{3, 4}));
  EXPECT_EQ(indices(queue.take(4, all)), (Indices{7, 8, 9, 10}));
  add(queue, last);
  EXPECT_EQ(indices(queue.take(4, all)), (Indices{11, 12, 0, 1})) << "as the first run's lease";
}

TEST(RunQueue, LeavesToCardsWhatIsForThem) {
  RunQueue queue;
  proto::RunLease for_cards = lease(1, 0, 3);
  for_cards.set_is_for_cards(true);
  add(queue, for_cards);
  add(queue, lease(1, 7, 2));
  EXPECT_EQ(indices(queue.take(2, those_for_cards)), (Indices{0, 1}));
  EXPECT_EQ(indices(queue.take(16, those_for_processors)), (Indices{7, 8}));
  EXPECT_TRUE(queue.take(16, those_for_processors).requests.empty());
  EXPECT_EQ(indices(queue.take(16, all)), Indices{2}) << "cards cannot compute it";
}

TEST(RunQueue, SaysWhichCampaignComesFirstForCards) {
  RunQueue queue;
  add(queue, lease(1, 0, 3));
  for (const std::uint64_t campaign : {2U, 3U}) {
    proto::RunLease for_cards = lease(campaign, 0, 3);
    for_cards.set_is_for_cards(true);
    add(queue, for_cards);
  }
  EXPECT_EQ(queue.first_campaign(those_for_cards), wire::CampaignId{2});
  EXPECT_EQ(queue.take(9, those_for_cards).requests.size(), 3U);
  EXPECT_EQ(queue.first_campaign(those_for_cards), wire::CampaignId{3});
}

TEST(RunQueue, MakesNoLargerBatchesThanTheWorkerCanWhateverALeaseWants) {
  RunQueue queue;
  proto::RunLease hostile = lease(1, 0, 5);
  hostile.set_batch_runs_max(0xffffffff);
  add(queue, hostile);
  EXPECT_EQ(indices(queue.take(4, all)), (Indices{0, 1, 2, 3}));
}

TEST(RunQueue, DropsWhatIsHereOfTheRangesOfACampaign) {
  RunQueue queue;
  add(queue, lease(1, 5, 5));
  add(queue, lease(1, 0, 2));
  add(queue, lease(2, 0, 10));
  (void)queue.take(2, all);
  const std::vector<RunIndex> dropped =
      queue.drop({1}, std::array{RunRange{{0}, 1}, RunRange{{4}, 5}});
  EXPECT_EQ(dropped, (std::vector<RunIndex>{{0}, {7}, {8}}));
  EXPECT_EQ(indices(queue.take(16, all)), (Indices{9, 1}));
  EXPECT_EQ(indices(queue.take(16, all)).size(), 10U);
}

TEST(RunQueue, DropsACampaign) {
  RunQueue queue;
  add(queue, lease(1, 0, 3));
  add(queue, lease(2, 7, 1));
  queue.drop({1});
  EXPECT_FALSE(queue.has({1}));
  EXPECT_TRUE(queue.has({2}));
  EXPECT_EQ(indices(queue.take(16, all)), Indices{7});
}

}  // namespace
}  // namespace proofmass::worker
