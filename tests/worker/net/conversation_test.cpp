#include "worker/net/conversation.hpp"

#include "tests/support/microscope_results.hpp"
#include "tests/worker/net/conversation_fixture.hpp"

namespace proofmass::worker {
namespace {

// Registration.

TEST_F(ConversationTest, SaysHelloUntilItIsWelcome) {
  start();
  const proto::Envelope first = take_envelope();
  EXPECT_EQ(first.hello().worker_name(), "w");
  EXPECT_EQ(first.session(), own_session.value);
  EXPECT_EQ(first.epoch(), 0U);
  EXPECT_EQ(first.sequence(), 1U);
  tick_after(240ms);
  EXPECT_TRUE(sent.empty());
  tick_after(80ms);  // A quarter more is the most that chance adds.
  (void)take_sent<proto::Hello>();

  receive(welcome);
  const proto::Envelope heartbeat = take_envelope();
  EXPECT_EQ(heartbeat.epoch(), first_epoch.value);
  EXPECT_EQ(heartbeat.sequence(), 3U);
  EXPECT_EQ(heartbeat.heartbeat().num_runs_max(), wire::runs_per_lease_max);
  receive(welcome);  // The answer to the other Hello changes nothing.
  tick_after(1s);
}

// 0.25 + 0.5 + ... + 32 s take 63.75 s, with chance at most a quarter more; from then on a Hello
// comes every 32 to 40 s.
TEST_F(ConversationTest, SaysHelloEverMoreSeldom) {
  start();
  for (int i = 0; i < 800; ++i) tick_after(100ms);
  EXPECT_GE(sent.size(), 8U);
  EXPECT_LE(sent.size(), 9U);
  sent.clear();
  for (int i = 0; i < 4000; ++i) tick_after(100ms);
  EXPECT_GE(sent.size(), 9U);
  EXPECT_LE(sent.size(), 13U);
  sent.clear();
}

TEST_F(ConversationTest, SaysHelloAtOtherTimesThanOtherWorkers) {
  std::set<int> ticks_at_second_hello;
  for (std::uint64_t worker = 1; worker <= 20; ++worker) {
    std::size_t num_sent = 0;
    Conversation other(
        {worker}, hello, execution, [&](const proto::Envelope&) { ++num_sent; }, now);
    int num_ticks = 0;
    while (num_sent < 2) other.on_tick(now + ++num_ticks * 1ms);
    ticks_at_second_hello.insert(num_ticks);
  }
  EXPECT_GT(ticks_at_second_hello.size(), 10U);
}

// The first Hello is lost if the connection was not there yet.
TEST_F(ConversationTest, SaysHelloAgainOnceItIsConnected) {
  start();
  (void)take_sent<proto::Hello>();
  now += 10ms;
  conversation->on_connected(now);
  (void)take_sent<proto::Hello>();
  tick_after(100ms);
}

// Another coordinator may sit at the address now: the sooner it is asked the better.
TEST_F(ConversationTest, SaysAllItHoldsOnceItIsConnectedAgain) {
  register_with_campaign();
  (void)compute(lease(10, 1));
  conversation->on_connected(now);
  EXPECT_EQ(test::vector_of(take_sent<proto::Heartbeat>().held()), held(10, 1));
  (void)take_sent<proto::ResultBatch>();
}

TEST_F(ConversationTest, SaysHelloOnceIfItIsRejectedTwice) {
  register_with_campaign();
  reject_unregistered();
  reject_unregistered();
  (void)take_sent<proto::Hello>();
}

TEST_F(ConversationTest, IgnoresWhatWasMeantForOthers) {
  register_with_campaign();
  receive_in({78}, proto::Stop());         // A former session.
  receive(proto::Stop(), wire::Epoch{4});  // A former coordinator.
  EXPECT_FALSE(conversation->ending().has_value());
}

TEST_F(ConversationTest, GivesUpACoordinatorThatIsSilent) {
  start({.give_up_after = 60s});
  (void)take_sent<proto::Hello>();
  now += 10s;
  receive(welcome);
  tick_after(59s);
  EXPECT_FALSE(conversation->ending().has_value());
  sent.clear();
  tick_after(1s);
  expect_ending(
      Ending::Kind::failed,
      "coordinator = silent for 60 s (is it running, and is this its address for workers?)");
}

TEST_F(ConversationTest, DoesNotCountTheTimeInWhichItWasStopped) {
  start({.give_up_after = 60s});
  (void)take_sent<proto::Hello>();
  conversation->on_slept(3600s);
  tick_after(3659s);
  EXPECT_FALSE(conversation->ending().has_value());
  sent.clear();
  tick_after(1s);
  expect_ending(
      Ending::Kind::failed,
      "coordinator = silent for 60 s (is it running, and is this its address for workers?)");
}

TEST_F(ConversationTest, SaysWhyItWasNotLetIn) {
  start({.give_up_after = 60s});
  conversation->on_refused("the key of this worker is not on its list");
  tick_after(60s);
  sent.clear();
  expect_ending(Ending::Kind::failed,
                "coordinator = silent for 60 s (the key of this worker is not on its list)");
}

// Heartbeats.

TEST_F(ConversationTest, SaysSoonWhatItComputesNow) {
  register_with_campaign();
  receive(lease(12, 3));
  execution.begin_batch();
  tick_after(900ms);
  EXPECT_TRUE(sent.empty());
  tick_after(100ms);
  EXPECT_EQ(take_sent<proto::Heartbeat>().computing_size(), 1);
  tick_after(1900ms);
  EXPECT_TRUE(sent.empty()) << "it computes the same";
  execution.finish_batch();
  tick_after(0s);
  EXPECT_TRUE(take_sent<proto::Heartbeat>().computing().empty());
}

TEST_F(ConversationTest, NamesAsManyBatchesAsAMessageTakes) {
  register_with_campaign();
  const auto every_second_run = [](std::uint64_t first, std::size_t count) {
    RunningBatch batch{
        .number = first + 1, .campaign = campaign_1, .ranges = {}, .time_left = std::nullopt};
    for (std::size_t i = 0; i < count; ++i) batch.ranges.push_back({{first + 2 * i}, 1});
    return batch;
  };
  execution.batches = {every_second_run(0, 4000), every_second_run(10'000, 97),
                       every_second_run(20'000, 96)};
  tick_after(2s);
  const auto heartbeat = take_sent<proto::Heartbeat>();
  ASSERT_EQ(heartbeat.computing_size(), 2);
  EXPECT_EQ(heartbeat.computing(1).ranges_size(), 96);
  tick_after(1s);
  EXPECT_TRUE(sent.empty()) << "it computes the same";
}

TEST_F(ConversationTest, CountsUnacknowledgedResultsAgainstItsCredit) {
  register_with_campaign();
  (void)compute(lease(0, 96));
  tick_after(2s);
  EXPECT_EQ(take_sent<proto::Heartbeat>().num_runs_max(), 4000U);
}

// Of runs 0 to 5, run 1 is finished and run 3 waits.
TEST_F(ConversationTest, TakesFromALeaseWhatItDoesNotHold) {
  register_with_campaign();
  (void)compute(lease(1, 1));
  receive(lease(3, 1));
  proto::RunLease all = lease(0, 6, 2);
  all.set_is_alone(true);
  all.set_batch_runs_max(7);
  receive(all);
  ASSERT_EQ(execution.waiting.size(), 4U);
  EXPECT_EQ(execution.waiting[1].runs, (RunRange{{0}, 1}));
  EXPECT_EQ(execution.waiting[2].runs, (RunRange{{2}, 1}));
  EXPECT_EQ(execution.waiting[3].runs, (RunRange{{4}, 2}));
  EXPECT_TRUE(execution.waiting[3].is_alone);
  EXPECT_EQ(execution.waiting[3].batch_runs_max, 7U);
}

// Leases.

// The runs were taken from this worker and lent to it again before it said that it has them.
TEST_F(ConversationTest, NamesTheLargestAttemptUnderWhichItWasLentARun) {
  register_with_campaign();
  receive(lease(10, 1, 1));
  receive(lease(10, 1, 3));
  receive(lease(10, 1, 2));
  tick_after(2s);
  EXPECT_EQ(test::vector_of(take_sent<proto::Heartbeat>().held()), held(10, 1, 3));
  execution.finish_lease();
  conversation->on_progress(now);
  EXPECT_EQ(take_sent<proto::ResultBatch>().attempt(), 3U);
}

// Results.

// After 5, 10, 20, 40, 60, 60 s.
TEST_F(ConversationTest, RepeatsResultsEverMoreSeldom) {
  register_with_campaign();
  (void)compute(lease(10, 1));
  std::vector<int> repeated_at_s;
  for (int time_s = 1; time_s <= 200; ++time_s) {
    tick_after(1s);
    while (!sent.empty()) {
      if (take_envelope().has_result_batch()) repeated_at_s.push_back(time_s);
    }
  }
  EXPECT_EQ(repeated_at_s, (std::vector<int>{5, 15, 35, 75, 135, 195}));
}

TEST_F(ConversationTest, IgnoresAnAcknowledgementOfAnotherCampaign) {
  register_with_campaign();
  (void)compute(lease(10, 1));
  receive(test::make_ack(campaign_2, {{10}}));
  EXPECT_EQ(conversation->unacknowledged().size(), 1U);
}

TEST_F(ConversationTest, DeliversTheResultsOfAFormerProcess) {
  start();
  wire::LeasedResult result{campaign_2, {3}, {}};
  result.computed.result = test::zero_result({.run = {9}});
  conversation->restore({result});
  (void)take_sent<proto::Hello>();
  receive(welcome);
  const std::vector expected{test::make_held(campaign_2, {3}, {{{9}, 1}})};
  EXPECT_EQ(test::vector_of(take_sent<proto::Heartbeat>().held()), expected);
  EXPECT_EQ(take_sent<proto::ResultBatch>().attempt(), 3U);
  EXPECT_EQ(conversation->unacknowledged().all().at(0).computed.result.run, RunIndex{9});
}

// A message has room for 4096 results.
TEST_F(ConversationTest, SendsManyResultsOneMessageATick) {
  start();
  std::vector<wire::LeasedResult> results(2 * wire::runs_per_lease_max + 1);
  for (std::size_t i = 0; i < results.size(); ++i) {
    results[i].campaign = campaign_1;
    results[i].computed.result = test::zero_result({.run = {i}});
  }
  conversation->restore(results);
  (void)take_sent<proto::Hello>();
  receive(welcome);
  EXPECT_EQ(take_sent<proto::Heartbeat>().num_runs_max(), 0U);
  EXPECT_EQ(take_sent<proto::ResultBatch>().results_size(), int{wire::runs_per_lease_max});
  tick_after(100ms);
  EXPECT_EQ(take_sent<proto::ResultBatch>().results_size(), int{wire::runs_per_lease_max});
  tick_after(100ms);
  EXPECT_EQ(take_sent<proto::ResultBatch>().results_size(), 1);
  tick_after(100ms);
}

}  // namespace
}  // namespace proofmass::worker
