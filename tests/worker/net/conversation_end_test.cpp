#include "tests/worker/net/conversation_fixture.hpp"

// How a conversation ends.

namespace proofmass::worker {
namespace {

TEST_F(ConversationTest, EndsIfNothingCanBeComputed) {
  register_with_campaign();
  receive(lease(0, 1));
  receive(lease(1, 1));
  execution.finish_lease();
  execution.failure_text = "out of memory";
  conversation->on_progress(now);
  EXPECT_EQ(take_sent<proto::Bye>().reason(), proto::LOSS_REASON_FAILED);
  expect_ending(Ending::Kind::failed, "out of memory");
  EXPECT_EQ(conversation->unacknowledged().size(), 1U) << "what was finished can be kept";
}

TEST_F(ConversationTest, DropsEverythingWhenToldToStop) {
  register_with_campaign();
  receive(lease(0, 2));
  receive(proto::Stop());
  EXPECT_EQ(execution.num_abandons, 1);
  expect_ending(Ending::Kind::done, "told to stop");
}

// The lease crossed the Drain. Its first run is here already and is not given back.
TEST_F(ConversationTest, GivesBackALeaseThatComesTooLate) {
  register_with_campaign();
  receive(lease(0, 1));
  receive(proto::Drain());
  (void)take_sent<proto::Heartbeat>();
  receive(lease(0, 3));
  const auto answer = take_sent<proto::GiveBack>();
  EXPECT_EQ(answer.reason(), proto::LOSS_REASON_DRAINED);
  EXPECT_EQ(test::vector_of(answer.runs()), held(1, 2));
  EXPECT_EQ(execution.waiting.size(), 1U);
  receive(lease(0, 1));
}

TEST_F(ConversationTest, GivesBackRunsOfEachCampaign) {
  register_with_campaign();
  execution.defined.insert(campaign_2);
  receive(lease(2, 1));
  receive(lease(7, 1, 1, campaign_2));
  receive(lease(3, 1));
  conversation->on_drain_request(now);
  (void)take_sent<proto::Heartbeat>();
  EXPECT_EQ(test::vector_of(take_sent<proto::GiveBack>().runs()), held(2, 2));
  EXPECT_EQ(take_sent<proto::GiveBack>().runs(0).campaign(), campaign_2.value);
  expect_left(proto::LOSS_REASON_PREEMPTED, "asked to end");
}

TEST_F(ConversationTest, EndsAtOnceIfItHoldsNothing) {
  start();
  (void)take_sent<proto::Hello>();
  conversation->on_drain_request(now);
  EXPECT_TRUE(sent.empty()) << "nobody knows it";
  expect_ending(Ending::Kind::done, "asked to end");
}

TEST_F(ConversationTest, LeavesAtOnceWhenAskedAgain) {
  register_with_campaign();
  receive(lease(0, 2));
  execution.begin_batch();
  conversation->on_drain_request(now);
  (void)take_sent<proto::Heartbeat>();
  conversation->on_abandon_request();
  EXPECT_EQ(take_sent<proto::Bye>().reason(), proto::LOSS_REASON_PREEMPTED);
  EXPECT_EQ(execution.num_abandons, 1);
  expect_ending(Ending::Kind::done, "asked to end at once");
}

// 20 s are there, 5 of them for the delivery: a batch that takes 16 s more is given back, one that
// takes 14 s and one whose pace is not known are not.
TEST_F(ConversationTest, GivesBackBatchesThatDoNotFitIntoTheTime) {
  register_with_campaign({.drain_time = 20s});
  for (std::uint64_t run = 0; run < 3; ++run) {
    receive(lease(run, 1));
    execution.begin_batch();
  }
  execution.batches[0].time_left = 14s;
  execution.batches[1].time_left = 16s;
  conversation->on_drain_request(now);
  (void)take_sent<proto::Heartbeat>();
  tick_after(0s);
  const auto given_back = take_sent<proto::GiveBack>();
  EXPECT_EQ(given_back.reason(), proto::LOSS_REASON_PREEMPTED);
  EXPECT_EQ(test::vector_of(given_back.runs()), held(1, 1));
  EXPECT_EQ(execution.batches.size(), 2U);

  execution.batches[0].time_left = 0s;
  tick_after(15s);
  EXPECT_EQ(test::vector_of(take_sent<proto::GiveBack>().runs()), held(0, 1));
  EXPECT_EQ(test::vector_of(take_sent<proto::GiveBack>().runs()), held(2, 1));
  expect_left(proto::LOSS_REASON_PREEMPTED, "asked to end");
}

TEST_F(ConversationTest, EndsWhenTheDrainTakesTooLong) {
  register_with_campaign({.drain_time = 20s});
  (void)compute(lease(0, 2));
  conversation->on_drain_request(now);
  sent.clear();
  tick_after(19s);
  sent.clear();
  tick_after(1s);
  expect_left(proto::LOSS_REASON_PREEMPTED, "out of time with 2 results not acknowledged");
}

// A worker that cannot deliver, as the file is gone, outlives the coordinator that drained it, and
// would never be lent anything again. Who drains it anew must say so.
TEST_F(ConversationTest, WorksForANewCoordinatorAfterTheDrainOfTheFormer) {
  register_with_campaign();
  (void)compute(lease(0, 1));
  receive(proto::Drain());
  EXPECT_EQ(take_sent<proto::Heartbeat>().num_runs_max(), 0U);
  reject_unregistered(first_epoch);  // Of the same process: it is still draining.
  (void)take_sent<proto::Hello>();
  receive(welcome, first_epoch);
  EXPECT_EQ(take_sent<proto::Heartbeat>().num_runs_max(), 0U);
  (void)take_sent<proto::ResultBatch>();
  reject_unregistered(wire::Epoch{6});
  (void)take_sent<proto::Hello>();
  receive(welcome, wire::Epoch{6});
  EXPECT_GT(take_sent<proto::Heartbeat>().num_runs_max(), 0U);
  (void)take_sent<proto::ResultBatch>();
  receive(test::make_ack(campaign_1, {{0}}), wire::Epoch{6});
  EXPECT_FALSE(conversation->ending().has_value());
  receive(proto::Drain(), wire::Epoch{6});
  EXPECT_EQ(take_sent<proto::Heartbeat>().num_runs_max(), 0U);
  expect_left(proto::LOSS_REASON_DRAINED, "drained");
}

// What is given back while nobody knows the worker is not in the heartbeat of the next Welcome.
TEST_F(ConversationTest, GivesBackByNotNamingRunsIfItIsNotRegistered) {
  register_with_campaign();
  (void)compute(lease(0, 1));
  receive(lease(1, 5));
  reject_unregistered(wire::Epoch{6});
  (void)take_sent<proto::Hello>();
  conversation->on_drain_request(now);
  EXPECT_TRUE(sent.empty());
  receive(welcome, wire::Epoch{6});
  EXPECT_EQ(test::vector_of(take_sent<proto::Heartbeat>().held()), held(0, 1));
  (void)take_sent<proto::ResultBatch>();
}

// Batches take 60 s: with half of that to spare and twice 5 s to deliver and to end, it is time at
// least 100 s before the walltime is over, and at most 60 s earlier.
TEST_F(ConversationTest, DrainsInTimeBeforeItsWalltimeIsOver) {
  register_with_campaign({.walltime_end = now + 1000s});
  execution.batch_time = 60s;
  receive(lease(0, 1));
  execution.begin_batch();
  receive(lease(1, 1));
  tick_after(839s);
  EXPECT_FALSE(conversation->is_leaving());
  sent.clear();
  tick_after(61s);
  EXPECT_EQ(take_sent<proto::Heartbeat>().num_runs_max(), 0U);
  const auto given_back = take_sent<proto::GiveBack>();
  EXPECT_EQ(given_back.reason(), proto::LOSS_REASON_WALLTIME);
  EXPECT_EQ(test::vector_of(given_back.runs()), held(1, 1));
  execution.finish_batch();
  conversation->on_progress(now);
  (void)take_sent<proto::ResultBatch>();
  acknowledge({{0}});
  EXPECT_EQ(take_sent<proto::Bye>().reason(), proto::LOSS_REASON_WALLTIME);
}

// A quarter of the workers of a job leaves in each quarter of those 60 s, but for chance.
TEST_F(ConversationTest, LeavesBeforeItsWalltimeAtAnotherTimeThanOtherWorkers) {
  const TimePoint beginning = now;
  execution.batch_time = 60s;
  constexpr int num_workers = 400;
  std::array<int, 4> num_leaving{};
  for (int worker = 0; worker < num_workers; ++worker) {
    session = {static_cast<std::uint64_t>(worker + 1)};
    now = beginning;
    register_with_campaign({.walltime_end = now + 1000s});
    now += 840s;
    std::size_t quarter = 0;
    for (; quarter < num_leaving.size() && !conversation->is_leaving(); ++quarter) tick_after(15s);
    ASSERT_TRUE(conversation->is_leaving());
    ++num_leaving.at(quarter - 1);
    sent.clear();
  }
  // Five standard deviations of a binomial law.
  for (const int num : num_leaving) EXPECT_NEAR(num, num_workers / 4, 44);
}

// Told to deliver all that it holds, however long that takes; but its time is not endless.
TEST_F(ConversationTest, HeedsItsWalltimeAlsoWhenDrainedByTheCoordinator) {
  register_with_campaign({.walltime_end = now + 100s});
  receive(lease(0, 1));
  receive(proto::Drain());
  sent.clear();
  tick_after(90s);
  (void)take_sent<proto::Heartbeat>();
  EXPECT_EQ(take_sent<proto::GiveBack>().reason(), proto::LOSS_REASON_WALLTIME);
  expect_left(proto::LOSS_REASON_WALLTIME, "its time is up");
}

// The batch system kills it at 30 s, whatever it was asked before: its results must be kept by
// then.
TEST_F(ConversationTest, HeedsItsWalltimeAlsoWhenAskedToEnd) {
  register_with_campaign({.drain_time = 100s, .walltime_end = now + 30s});
  (void)compute(lease(0, 2));
  receive(lease(2, 1));
  execution.begin_batch();
  execution.batches[0].time_left = 50s;
  conversation->on_drain_request(now);
  (void)take_sent<proto::Heartbeat>();
  tick_after(0s);
  EXPECT_EQ(test::vector_of(take_sent<proto::GiveBack>().runs()), held(2, 1))
      << "it would end after the walltime";
  tick_after(24s);
  EXPECT_FALSE(conversation->ending().has_value());
  sent.clear();
  tick_after(1s);
  expect_left(proto::LOSS_REASON_PREEMPTED, "out of time with 2 results not acknowledged");
}

// It leaves 100 to 160 s before the end of its walltime, and is then to leave within 3 s.
TEST_F(ConversationTest, HeedsTheDrainTimeAlsoWhenItsWalltimeIsNearlyOver) {
  register_with_campaign({.drain_time = 3s, .walltime_end = now + 100s});
  (void)compute(lease(0, 2));
  execution.batch_time = 60s;
  tick_after(0s);
  EXPECT_TRUE(conversation->is_leaving());
  conversation->on_drain_request(now);
  sent.clear();
  tick_after(2s);
  EXPECT_FALSE(conversation->ending().has_value());
  sent.clear();
  tick_after(1s);
  expect_left(proto::LOSS_REASON_PREEMPTED, "out of time with 2 results not acknowledged");
}

TEST_F(ConversationTest, GetsNoTimeBeyondItsWalltimeByBeingAskedToEnd) {
  register_with_campaign({.drain_time = 100s, .walltime_end = now + 100s});
  (void)compute(lease(0, 1));
  tick_after(90s);
  EXPECT_TRUE(conversation->is_leaving());
  sent.clear();
  conversation->on_drain_request(now);
  EXPECT_TRUE(sent.empty());
  tick_after(5s);
  expect_left(proto::LOSS_REASON_WALLTIME, "out of time with 1 results not acknowledged");
}

TEST_F(ConversationTest, LeavesAfterTheIdleTimeout) {
  register_with_campaign({.idle_timeout = 300s});
  now += 299s;
  conversation->on_slept(298s);
  tick_after(1s);  // The coordinator has been silent for 2 s, and the worker idle for as long.
  (void)take_sent<proto::Heartbeat>();
  EXPECT_FALSE(conversation->ending().has_value());
  tick_after(298s);
  expect_left(proto::LOSS_REASON_DRAINED, "no run for 300 s");
}

// A batch system is to see that a job has computed nothing because of a mistyped address.
TEST_F(ConversationTest, HasFailedIfNoCoordinatorTookItInItsTime) {
  start({.idle_timeout = 30s});
  tick_after(30s);
  sent.clear();
  expect_ending(Ending::Kind::failed,
                "no run for 30 s, and no coordinator has taken this worker (is it running, and is "
                "this its address for workers?)");
  start({.walltime_end = now + 50s});
  conversation->on_refused("key not listed");
  tick_after(40s);
  sent.clear();
  expect_ending(Ending::Kind::failed,
                "its time is up, and no coordinator has taken this worker (key not listed)");
}

TEST_F(ConversationTest, ForgetsWhyItWasRefusedOnceItIsRegistered) {
  start();
  receive(test::make_reject(proto::REJECT_REASON_FULL, "enough workers"));
  receive(welcome);
  sent.clear();
  tick_after(std::chrono::hours(1));
  expect_ending(
      Ending::Kind::failed,
      "coordinator = silent for 3600 s (is it running, and is this its address for workers?)");
}

TEST_F(ConversationTest, IsNotIdleWithARunOrAResult) {
  register_with_campaign({.resend_after = std::chrono::hours(1), .idle_timeout = 300s});
  receive(lease(0, 1));
  tick_after(400s);
  (void)take_sent<proto::Heartbeat>();
  execution.finish_lease();
  conversation->on_progress(now);
  (void)take_sent<proto::ResultBatch>();
  tick_after(400s);
  (void)take_sent<proto::Heartbeat>();
  acknowledge({{0}});
  tick_after(299s);
  (void)take_sent<proto::Heartbeat>();
  EXPECT_FALSE(conversation->ending().has_value());
  tick_after(1s);
  expect_left(proto::LOSS_REASON_DRAINED, "no run for 300 s");
}

TEST_F(ConversationTest, StaysIdleWithoutATimeout) {
  register_with_campaign();
  for (int i = 0; i < 50; ++i) {
    receive(proto::HeartbeatAck());
    tick_after(3000s);
    (void)take_sent<proto::Heartbeat>();
  }
  EXPECT_FALSE(conversation->ending().has_value());
}

}  // namespace
}  // namespace proofmass::worker
