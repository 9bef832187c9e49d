// What a worker does that the coordinator does not let in.

#include "tests/worker/net/conversation_fixture.hpp"

namespace proofmass::worker {
namespace {

using namespace std::chrono_literals;
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

TEST_F(RefusalTest, IsFinalIfItIsIncompatible) {
  start();
  (void)take_sent<proto::Hello>();
  refuse(proto::REJECT_REASON_INCOMPATIBLE);
  expect_ending(Ending::Kind::failed, "refused by the coordinator: not now");
}

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

TEST_F(RefusalTest, GoesOnComputingMeanwhile) {
  register_with_campaign();
  receive(lease(10, 2));
  refuse(proto::REJECT_REASON_FULL);
  EXPECT_EQ(execution.num_abandons, 0);
  execution.finish_lease();
  conversation->on_progress(now);
  EXPECT_EQ(conversation->num_unacknowledged(), 2U);
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

}  // namespace
}  // namespace proofmass::worker
