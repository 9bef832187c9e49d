// Heartbeats make both sides agree about what a worker holds.

#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

using namespace std::chrono_literals;
using Ranges = std::vector<RunRange>;

class HeartbeatTest : public DispatchFixture {
 protected:
  /// The first worker has been lent run 0 of three.
  void lend_one() {
    add_campaign(one, 3);
    add_worker(first);
    outbox.forget();
  }
};

TEST_F(HeartbeatTest, ALeaseThatNeverArrivedIsLentAgain) {
  lend_one();
  now += 11s;
  heartbeat(first);  // The lease may be under way.
  outbox.expect_nothing_more();

  now += 1s;
  heartbeat(first);
  EXPECT_EQ(outbox.take_events(),
            Strings{"runs_lost worker=1 runs=0 attempt=1 reason=never_arrived"});
  EXPECT_EQ(outbox.take_losses().at(0).reason, LossReason::never_arrived);
  const auto again = outbox.take_sent<proto::RunLease>(first);
  EXPECT_EQ(wire::runs_of(again), (RunRange{{0}, 1}));
  EXPECT_EQ(again.attempt(), 2U);
}

TEST_F(HeartbeatTest, ALeaseIsNotMissedInAHeartbeatThatHasWaited) {
  lend_one();
  state.is_behind = true;
  now += 12s;
  heartbeat(first);
  EXPECT_EQ(state.leases.size(), 1U);
  outbox.expect_nothing_more();
}

TEST_F(HeartbeatTest, ALeaseThatIsHeldStays) {
  lend_one();
  now += 1h;
  heartbeat(first, {held(one, {{0}, 1})});
  EXPECT_EQ(state.leases.size(), 1U);
}

TEST_F(HeartbeatTest, AnOpenRunThatAWorkerHoldsIsLentToIt) {
  lend_one();
  heartbeat(first, {held(one, {{0}, 3}, 4)});
  outbox.expect_nothing_more();  // It has them: no message is needed.
  EXPECT_EQ(state.workers.at(first).num_lent, 3U);
  const auto& adopted = state.leases.at(*campaign(one).lent.find({2}));
  EXPECT_EQ(adopted.attempt, Attempt{4});
  EXPECT_EQ(adopted.known_as, Attempt{4});
}

// The attempt only grows, but the worker will name the runs by the one that it knows.
TEST_F(HeartbeatTest, AnAdoptedRunIsGivenBackUnderTheAttemptThatTheWorkerKnows) {
  lend_one();
  now += 60s;
  on_tick(state, now, outbox);  // Run 0 is pending for its second attempt.
  add_campaign(two, 1);
  outbox.forget();
  say_hello(first, hello());
  outbox.forget();
  heartbeat(first, {held(one, {{0}, 1}, 1)}, {}, 1);
  EXPECT_EQ(state.leases.at(*campaign(one).lent.find({0})).attempt, Attempt{2});

  on_give_back(state, first, make_give_back(LossReason::walltime, {held(one, {{0}, 1}, 2)}), now,
               outbox);
  outbox.expect_nothing_more();
  on_give_back(state, first, make_give_back(LossReason::walltime, {held(one, {{0}, 1}, 1)}), now,
               outbox);
  EXPECT_EQ(outbox.take_losses().at(0).attempt, Attempt{2});
  outbox.forget();
}

TEST_F(HeartbeatTest, NobodyIsLentMoreThanAWorkerCanHoldBecauseItSaysSo) {
  add_campaign(one, 1'000'000);
  add_worker(first);
  outbox.forget();
  heartbeat(first, {held(one, {{0}, 1'000'000})});
  EXPECT_EQ(state.workers.at(first).num_lent, 1U);
  EXPECT_EQ(wire::ranges_of(outbox.take_sent<proto::Retract>(first).ranges()),
            (Ranges{{{1}, 999'999}}));
}

TEST_F(HeartbeatTest, ARunThatIsLentToAnotherWorkerIsAskedBack) {
  lend_one();
  add_worker(second);
  outbox.forget();
  heartbeat(second, {held(one, {{0}, 2})});
  EXPECT_EQ(wire::ranges_of(outbox.take_sent<proto::Retract>(second).ranges()), (Ranges{{{0}, 1}}));
  EXPECT_TRUE(state.workers.at(second).unleased.at(one).contains({0}));
  on_give_back(state, second, make_give_back(LossReason::retracted, {held(one, {{0}, 1})}), now,
               outbox);
  EXPECT_TRUE(state.workers.at(second).unleased.empty());
}

TEST_F(HeartbeatTest, AStoredRunThatStillWaitsIsAskedBack) {
  lend_one();
  complete(first, one, {0});
  heartbeat(first, {held(one, {{0}, 3})});
  EXPECT_EQ(wire::ranges_of(outbox.take_sent<proto::Retract>(first).ranges()), (Ranges{{{0}, 1}}));
}

TEST_F(HeartbeatTest, ADeliveredRunNeedsNothing) {
  lend_one();
  deliver(first, one, {0});
  outbox.forget();
  heartbeat(first, {held(one, {{0}, 3})});
}

// It may be served later, when its file can be opened: its results must not be thrown away.
TEST_F(HeartbeatTest, ACampaignThatIsNotServedIsKept) {
  lend_one();
  heartbeat(first, {held(one, {{0}, 1}), held(two, {{0}, 5})});
  const auto not_served = outbox.take_sent<proto::NotServed>(first);
  EXPECT_EQ(not_served.campaign(), two.value);
  EXPECT_TRUE(wire::ranges_of(not_served.ranges()).empty());
}

TEST_F(HeartbeatTest, ACampaignThatHasEndedIsForgotten) {
  lend_one();
  on_ended(state, two, 5);
  heartbeat(first, {held(one, {{0}, 1}), held(two, {{0}, 5})});
  const auto forget = outbox.take_sent<proto::Forget>(first);
  EXPECT_EQ(forget.campaign(), two.value);
  EXPECT_EQ(forget.num_runs(), 5U);
}

TEST_F(HeartbeatTest, RunsThatAreGivenBackAreLentAgain) {
  lend_one();
  on_give_back(state, first, make_give_back(LossReason::preempted, {held(one, {{0}, 1})}), now,
               outbox);
  EXPECT_EQ(outbox.take_events(), Strings{"runs_lost worker=1 runs=0 attempt=1 reason=preempted"});
  EXPECT_EQ(outbox.take_losses().at(0).reason, LossReason::preempted);
  EXPECT_EQ(outbox.take_sent<proto::RunLease>(first).attempt(), 2U);
}

// A message that was long under way must not take back what has been lent anew since.
TEST_F(HeartbeatTest, AGiveBackOfAnOlderAttemptIsIgnored) {
  lend_one();
  on_give_back(state, first, make_give_back(LossReason::retracted, {held(one, {{0}, 1})}), now,
               outbox);
  outbox.forget();
  on_give_back(state, first, make_give_back(LossReason::retracted, {held(one, {{0}, 1})}), now,
               outbox);
  EXPECT_TRUE(campaign(one).lent.find({0}).has_value());
}

TEST_F(HeartbeatTest, AfterARestartNothingIsLentUntilAllHaveSaidWhatTheyHold) {
  begin({session_of(first), session_of(second)});
  add_campaign(one, 3);
  add_worker(first);
  add_worker(third);
  outbox.expect_nothing_more();
  say_hello(second, hello());
  outbox.forget();
  heartbeat(second, {held(one, {{0}, 1})});
  EXPECT_EQ(state.leases.at(*campaign(one).lent.find({0})).worker, second);
  EXPECT_EQ(wire::runs_of(outbox.take_sent<proto::RunLease>(first)), (RunRange{{1}, 1}));
  EXPECT_EQ(wire::runs_of(outbox.take_sent<proto::RunLease>(third)), (RunRange{{2}, 1}));
}

TEST_F(HeartbeatTest, AfterARestartNothingIsLentBeforeTheWaitIsOver) {
  begin({session_of(second)});
  add_campaign(one, 3);
  add_worker(first);
  now += 14s;
  on_tick(state, now, outbox);
  outbox.expect_nothing_more();
  now += 1s;
  heartbeat(first);
  (void)outbox.take_sent<proto::RunLease>(first);
}

TEST_F(HeartbeatTest, AfterARestartOneThatCrashedMeanwhileIsNotAwaited) {
  begin({session_of(second)});
  add_campaign(one, 3);
  proto::Hello successor = hello();
  *successor.mutable_former() = make_former(session_of(second));
  say_hello(first, successor);
  outbox.forget();
  heartbeat(first);
  (void)outbox.take_sent<proto::RunLease>(first);
}

// What was finished before the restart is not computed again.
TEST_F(HeartbeatTest, AfterARestartAResultIsTakenAtOnce) {
  begin({session_of(first)});
  add_campaign(one, 1);
  say_hello(first, hello());
  outbox.forget();
  deliver(first, one, {0}, 3);
  EXPECT_EQ(outbox.stored().at(0).attempt, Attempt{3});
  EXPECT_EQ(outbox.take_stored(), Runs{{0}});
}

}  // namespace
}  // namespace proofmass::test
