// What a worker does with runs and results of campaigns that the coordinator does not serve.

#include "tests/support/microscope_results.hpp"
#include "tests/worker/net/conversation_fixture.hpp"

namespace proofmass::worker {
namespace {

using namespace std::chrono_literals;

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
  EXPECT_EQ(conversation->num_unacknowledged(), 2U);
  EXPECT_EQ(conversation->num_set_aside(), 2U);
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
  EXPECT_EQ(conversation->num_unacknowledged(), 0U);
  EXPECT_EQ(conversation->num_set_aside(), 0U);
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
  EXPECT_EQ(conversation->num_set_aside(), 2U);
  const proto::Heartbeat heartbeat = next_heartbeat();
  EXPECT_EQ(test::vector_of(heartbeat.held()), held(8, 2));
  EXPECT_EQ(test::vector_of(heartbeat.set_aside()), held(10, 2));
}

TEST_F(NotServedTest, ForgetLeavesRunsThatTheCoordinatorDoesNotKnow) {
  register_with_campaign();
  (void)compute(lease(8, 4));
  receive(lease(20, 1));
  execution.begin_batch();
  receive(lease(5, 1));
  receive(test::make_not_served(campaign_1, {{{10}, 2}}));
  (void)events();
  receive(test::make_forget(campaign_1, 10));
  EXPECT_EQ(events(), std::vector<std::string>{"results_forgotten campaign=0000000000000001 "
                                               "results=2 (finished or cancelled)"});
  EXPECT_EQ(conversation->num_unacknowledged(), 2U);
  EXPECT_EQ(conversation->num_set_aside(), 2U);
  EXPECT_EQ(conversation->num_unfinished(), 1U) << "run 20 is being computed";
  EXPECT_TRUE(execution.forgotten.empty());
  execution.finish_batch();
  conversation->on_progress(now);
  EXPECT_EQ(take_sent<proto::ResultBatch>().results_size(), 1);
  receive(test::make_forget(campaign_1));
  EXPECT_EQ(conversation->num_unacknowledged(), 0U);
  EXPECT_EQ(conversation->num_set_aside(), 0U);
  EXPECT_EQ(execution.forgotten, std::vector{campaign_1});
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
