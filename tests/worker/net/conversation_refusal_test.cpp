#include "tests/support/microscope_results.hpp"
#include "tests/worker/net/conversation_fixture.hpp"

namespace proofmass::worker {
namespace {

// What a worker does that the coordinator does not let in.

using proto::RejectReason;

class RefusalTest : public ConversationTest {
 protected:
  void refuse(RejectReason reason) { receive(test::make_reject(reason, "not now"), first_epoch); }
  [[nodiscard]] std::vector<std::string> events() {
    std::vector<std::string> texts;
    for (const wire::Event& event : conversation->take_events()) texts.push_back(to_text(event));
    return texts;
  }
  /// Until it says something, in steps of 100 ms.
  Duration time_until_next_message() {
    const TimePoint start_at = now;
    while (sent.empty() && now - start_at < 10min) tick_after(100ms);
    return now - start_at;
  }
};

// The list of keys may have been cut off for a moment: then the handshakes fail, too.
TEST_F(RefusalTest, IsFinalIfTheKeyIsRevokedForMinutes) {
  start();
  (void)take_sent<proto::Hello>();
  refuse(proto::REJECT_REASON_REVOKED);
  const TimePoint revoked_at = now;
  int num_connections = 0;
  while (now - revoked_at < 299s) {
    tick_after(1s);
    if (conversation->take_reconnection()) ++num_connections;
    sent.clear();
    ASSERT_FALSE(conversation->ending().has_value());
  }
  EXPECT_GE(num_connections, 1);
  tick_after(1s);
  expect_ending(Ending::Kind::failed, "refused by the coordinator: not now");
}

TEST_F(RefusalTest, IsForgottenIfTheKeyIsListedAgain) {
  start();
  (void)take_sent<proto::Hello>();
  refuse(proto::REJECT_REASON_REVOKED);
  tick_after(200s);
  conversation->on_connected(now);
  receive(welcome);
  sent.clear();
  EXPECT_TRUE(conversation->is_registered());
  tick_after(200s);
  EXPECT_FALSE(conversation->ending().has_value());
  sent.clear();
}

TEST_F(RefusalTest, IsNotFinalIfThereAreTooManyWorkersOrTooMuchCrashed) {
  for (const RejectReason reason : {proto::REJECT_REASON_FULL, proto::REJECT_REASON_QUARANTINED}) {
    start();
    (void)take_sent<proto::Hello>();
    Duration least = 15s;
    for (int i = 0; i < 5; ++i) {
      refuse(reason);
      refuse(reason);  // The answer to a repeated Hello.
      const Duration passed = time_until_next_message();
      EXPECT_GE(passed, least);
      EXPECT_LE(passed, least + least / 4 + 100ms);
      (void)take_sent<proto::Hello>();
      EXPECT_FALSE(conversation->take_reconnection());
      least = std::min<Duration>(2 * least, 60s);
    }
    EXPECT_EQ(events(),
              std::vector<std::string>{"refused reason=\"not now\" (asks again every 15 to 60 s)"})
        << "once";
    receive(welcome);
    (void)take_sent<proto::Heartbeat>();
    EXPECT_TRUE(conversation->is_registered());
    EXPECT_FALSE(conversation->ending().has_value());
  }
}

TEST_F(RefusalTest, NeedsAnotherConnectionIfSomethingBrokeTheRules) {
  register_with_campaign();
  (void)compute(lease(10, 1));
  refuse(proto::REJECT_REASON_MALFORMED);
  EXPECT_FALSE(conversation->is_registered());
  EXPECT_FALSE(conversation->take_reconnection()) << "not at once";
  Duration passed{};
  while (!conversation->take_reconnection()) {
    tick_after(100ms);
    passed += 100ms;
    ASSERT_LT(passed, 20s);
    ASSERT_TRUE(sent.empty()) << "nobody listens";
  }
  EXPECT_GE(passed, 15s);
  EXPECT_FALSE(conversation->take_reconnection()) << "once";
  conversation->on_connected(now);
  (void)take_sent<proto::Hello>();
  receive(welcome);
  EXPECT_EQ(test::vector_of(take_sent<proto::Heartbeat>().held()), held(10, 1));
  EXPECT_EQ(take_sent<proto::ResultBatch>().results_size(), 1) << "what it computed is kept";
}

// Who cannot be understood at all is told so without the name of a session.
TEST_F(RefusalTest, IsHeardUnderAnySession) {
  start();
  (void)take_sent<proto::Hello>();
  receive_in({1}, test::make_reject(proto::REJECT_REASON_MALFORMED, "bad"));
  tick_after(1s);
  EXPECT_TRUE(sent.empty());
}

// The network may hold a refusal back until a later Hello was accepted.
TEST_F(RefusalTest, ThatIsOvertakenByTheWelcomeMeansNothing) {
  start();
  (void)take_sent<proto::Hello>();
  receive_in(own_session, welcome, first_epoch, 2);
  (void)take_sent<proto::Heartbeat>();
  for (const RejectReason reason :
       {proto::REJECT_REASON_FULL, proto::REJECT_REASON_NOT_REGISTERED}) {
    receive_in(own_session, test::make_reject(reason));
    EXPECT_TRUE(conversation->is_registered());
  }
}

TEST_F(RefusalTest, LongAfterTheOneBeforeBeginsAnew) {
  start();
  (void)take_sent<proto::Hello>();
  refuse(proto::REJECT_REASON_FULL);
  (void)time_until_next_message();
  (void)take_sent<proto::Hello>();
  refuse(proto::REJECT_REASON_FULL);
  now += 300s;
  conversation->on_tick(now);
  (void)take_sent<proto::Hello>();
  refuse(proto::REJECT_REASON_FULL);
  EXPECT_LE(time_until_next_message(), 19s);
  (void)take_sent<proto::Hello>();
}

// What a worker does with runs and results of campaigns that the coordinator does not serve.

class NotServedTest : public ConversationTest {
 protected:
  [[nodiscard]] std::vector<std::string> events() {
    std::vector<std::string> texts;
    for (const wire::Event& event : conversation->take_events()) texts.push_back(to_text(event));
    return texts;
  }
  proto::Heartbeat next_heartbeat() {
    sent.clear();
    tick_after(2s);
    const std::deque<proto::Envelope> messages = std::exchange(sent, {});
    const auto found = std::ranges::find_if(messages, &proto::Envelope::has_heartbeat);
    if (found == messages.end()) throw std::logic_error("no heartbeat was sent");
    return found->heartbeat();
  }
  /// So many results, of runs from `first` on, of a process before this one.
  void restore(wire::CampaignId campaign, std::uint64_t first, std::uint64_t count) {
    std::vector<wire::LeasedResult> results;
    for (std::uint64_t run = first; run < first + count; ++run) {
      wire::LeasedResult result{.campaign = campaign, .attempt = {1}, .computed = {}};
      result.computed.result = test::zero_result({.run = {run}});
      results.push_back(result);
    }
    conversation->restore(std::move(results));
  }
};

TEST_F(NotServedTest, ResultsAreKeptAndSentAgainEverMoreSeldom) {
  register_with_campaign();
  (void)compute(lease(10, 2));
  receive(test::make_not_served(campaign_1));
  EXPECT_EQ(conversation->unacknowledged().size(), 2U);
  EXPECT_EQ(conversation->unacknowledged().num_set_aside(), 2U);
  EXPECT_EQ(events(), std::vector<std::string>{"results_set_aside campaign=0000000000000001 "
                                               "results=2 (not served now)"});
  std::vector<int> sent_at_s;
  for (int second = 1; second <= 300; ++second) {
    tick_after(1s);
    for (const proto::Envelope& message : std::exchange(sent, {})) {
      if (!message.has_result_batch()) continue;
      sent_at_s.push_back(second);
      receive(test::make_not_served(campaign_1));
    }
  }
  EXPECT_EQ(sent_at_s, (std::vector<int>{5, 15, 35, 75, 135, 195, 255}));
  EXPECT_TRUE(events().empty()) << "once";
  acknowledge({{10}, {11}});
  EXPECT_EQ(conversation->unacknowledged().size(), 0U);
  EXPECT_EQ(conversation->unacknowledged().num_set_aside(), 0U);
}

TEST_F(NotServedTest, WhatWaitsIsGivenBackAndWhatIsComputedIsFinished) {
  register_with_campaign();
  receive(lease(10, 1));
  execution.begin_batch();
  receive(lease(11, 2));
  receive(test::make_not_served(campaign_1));
  const auto given_back = take_sent<proto::GiveBack>();
  EXPECT_EQ(given_back.reason(), proto::LOSS_REASON_RETRACTED);
  EXPECT_EQ(test::vector_of(given_back.runs()), held(11, 2));
  EXPECT_EQ(execution.batches.size(), 1U);
  EXPECT_TRUE(execution.forgotten.empty());
  execution.finish_batch();
  conversation->on_progress(now);
  EXPECT_EQ(take_sent<proto::ResultBatch>().results_size(), 1);
}

TEST_F(NotServedTest, OnlyTheRunsThatAreNamedAreSetAside) {
  register_with_campaign();
  (void)compute(lease(8, 4));
  receive(test::make_not_served(campaign_1, {{{10}, 2}, {{20}, 5}}));
  EXPECT_EQ(conversation->unacknowledged().num_set_aside(), 2U);
  const proto::Heartbeat heartbeat = next_heartbeat();
  EXPECT_EQ(test::vector_of(heartbeat.held()), held(8, 2));
  EXPECT_EQ(test::vector_of(heartbeat.set_aside()), held(10, 2));
}

TEST_F(NotServedTest, ResultsTakeHalfOfTheCreditAtMost) {
  start();
  restore(campaign_1, 0, 3000);
  restore(campaign_2, 0, 1000);
  (void)take_sent<proto::Hello>();
  receive(welcome);
  EXPECT_EQ(take_sent<proto::Heartbeat>().num_runs_max(), 96U);
  sent.clear();
  receive(test::make_not_served(campaign_1));
  EXPECT_EQ(next_heartbeat().num_runs_max(), 4096U - 2048U - 1000U);
}

TEST_F(NotServedTest, TheNumberOfResultsIsBounded) {
  start({.num_kept_max = 10'000});
  restore(campaign_1, 0, 9'950);
  (void)take_sent<proto::Hello>();
  receive(welcome);
  sent.clear();
  receive(test::make_not_served(campaign_1));
  EXPECT_EQ(next_heartbeat().num_runs_max(), 50U);
}

// What the worker computes must be named, or the coordinator takes it for lost.
TEST_F(NotServedTest, RunsAtHandAreNamedBeforeThoseSetAside) {
  start();
  for (std::uint64_t run = 0; run < 5000; ++run) restore(campaign_1, 2 * run, 1);
  (void)take_sent<proto::Hello>();
  receive(welcome);
  sent.clear();
  receive(test::make_not_served(campaign_1));
  execution.defined.insert(campaign_2);
  receive(lease(0, 1, 1, campaign_2));
  receive(lease(2, 1, 1, campaign_2));
  const proto::Heartbeat heartbeat = next_heartbeat();
  ASSERT_EQ(heartbeat.held_size(), 1);
  EXPECT_EQ(heartbeat.held(0).campaign(), campaign_2.value);
  EXPECT_EQ(heartbeat.held(0).ranges_size(), 2);
  ASSERT_EQ(heartbeat.set_aside_size(), 1);
  EXPECT_EQ(heartbeat.set_aside(0).ranges_size(), int{wire::ranges_per_message_max - 2});
}

}  // namespace
}  // namespace proofmass::worker
