// The end of a campaign: idle workers get a part of what others have.

#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

using namespace std::chrono_literals;
using Ranges = std::vector<RunRange>;

class TailTest : public DispatchFixture {
 protected:
  /// The first worker has all runs that are left, 1 to 4; two of them wait. The second is idle.
  void begin_tail() {
    add_campaign(one, 5);
    add_worker(first, 2);
    complete(first, one, {0});
    campaign(one).run_time_s = 10.0;
    heartbeat(first, {held(one, {{1}, 4})}, {make_computed_batch(one, {{{1}, 2}})});
    outbox.forget();
    ASSERT_EQ(runs_held_text(state, first), "1..4");
    add_worker(second, 2);
    ASSERT_EQ(outbox.num_sent(), 0U);
  }

  /// Nothing waits any more; the first worker computes 1 and 2.
  void begin_last_round() {
    begin_tail();
    complete(second, one, {3, 4});
    campaign(one).run_time_s = 10.0;
  }

  /// The second worker's copies, with the attempt.
  proto::RunLease take_copies() {
    const auto lease = outbox.take_sent<proto::RunLease>(second);
    EXPECT_EQ(wire::runs_of(lease), (RunRange{{1}, 2}));
    return lease;
  }

  /// Both workers compute 1 and 2, as the first is late with them.
  void begin_copies() {
    begin_last_round();
    now += 15s;
    heartbeat(second);
    on_tick(state, now, outbox);
    (void)take_copies();
  }
};

TEST_F(TailTest, AnIdleWorkerGetsWhatWaitsAtOthers) {
  begin_tail();
  on_tick(state, now, outbox);
  EXPECT_EQ(wire::ranges_of(outbox.take_sent<proto::Retract>(first).ranges()), (Ranges{{{3}, 2}}));
  on_give_back(state, first, make_give_back(LossReason::retracted, {held(one, {{3}, 2})}), now,
               outbox);
  const auto lease = outbox.take_sent<proto::RunLease>(second);
  EXPECT_EQ(wire::runs_of(lease), (RunRange{{3}, 2}));
  EXPECT_EQ(lease.attempt(), 2U);
  EXPECT_EQ(outbox.take_losses().at(0).reason, LossReason::retracted);
  EXPECT_EQ(
      outbox.take_events(),
      std::vector<std::string>{"runs_taken_back worker=1 runs=3..4 attempt=1 reason=retracted"});
}

TEST_F(TailTest, ItIsAskedForOnlyOnceInAWhile) {
  begin_tail();
  on_tick(state, now, outbox);
  outbox.forget();
  now += 4s;
  on_tick(state, now, outbox);
  outbox.expect_nothing_more();
  now += 1s;
  on_tick(state, now, outbox);
  (void)outbox.take_sent<proto::Retract>(first);
}

TEST_F(TailTest, NothingIsAskedBackWhileRunsArePending) {
  begin_tail();
  add_campaign(two, 100);
  outbox.forget();
  on_tick(state, now, outbox);
}

TEST_F(TailTest, ARunThatTakesTooLongIsCopied) {
  begin_last_round();
  now += 20s;
  heartbeat(first, {held(one, {{1}, 2})});
  heartbeat(second);
  on_tick(state, now, outbox);
  outbox.expect_nothing_more();
  now += 1s;
  on_tick(state, now, outbox);
  EXPECT_EQ(take_copies().attempt(), 2U);
  EXPECT_EQ(campaign(one).copies.size(), 2U);
  on_tick(state, now, outbox);
}

TEST_F(TailTest, TwoCopiesOfARunAreEnough) {
  begin_last_round();
  now += 14s;
  for (std::uint64_t id = 3; id <= 5; ++id) {
    heartbeat(WorkerId{1}, {held(one, {{1}, 2})});
    add_worker(WorkerId{id}, 2, "host-" + std::to_string(id));
  }
  heartbeat(second);
  now += 14s;
  on_tick(state, now, outbox);
  EXPECT_EQ(outbox.num_sent(), 2U);
  EXPECT_EQ(campaign(one).copies.at({1}).leases.size(), 2U);
  EXPECT_EQ(campaign(one).copies.at({1}).newest, Attempt{3});
  outbox.forget();
}

// Workers that compute nothing must not take all of them.
TEST_F(TailTest, AHostGetsOneCopyOfARunAtATime) {
  begin_last_round();
  now += 14s;
  for (std::uint64_t id = 3; id <= 5; ++id) {
    heartbeat(WorkerId{1}, {held(one, {{1}, 2})});
    add_worker(WorkerId{id}, 2);
  }
  heartbeat(second);
  now += 14s;
  on_tick(state, now, outbox);
  EXPECT_EQ(campaign(one).copies.at({1}).leases.size(), 1U);
  outbox.forget();
}

TEST_F(TailTest, ARunOfASuspectWorkerIsCopied) {
  begin_last_round();
  now += 15s;
  campaign(one).run_time_s = 1000.0;
  heartbeat(second);
  on_tick(state, now, outbox);
  (void)take_copies();
}

TEST_F(TailTest, TheCopyOfALostRunTakesItsPlace) {
  begin_copies();
  on_bye(state, first, LossReason::preempted, now, outbox);
  EXPECT_EQ(outbox.num_sent(), 0U);
  const auto& lease = state.leases.at(*campaign(one).lent.find({1}));
  EXPECT_EQ(lease.worker, second);
  EXPECT_EQ(lease.attempt, Attempt{2});
  EXPECT_EQ(lease.kind, coordinator::LeaseKind::first);
  outbox.forget();
}

TEST_F(TailTest, TheAttemptGrowsAlsoAfterCopiesThatWereLost) {
  begin_copies();
  on_bye(state, second, LossReason::preempted, now, outbox);
  on_bye(state, first, LossReason::preempted, now, outbox);
  EXPECT_TRUE(campaign(one).pending.contains(Attempt{3}));
  EXPECT_TRUE(campaign(one).copies.empty());
  outbox.forget();
}

TEST_F(TailTest, TheFirstResultCountsAndTheOtherWorkerIsAskedBack) {
  begin_copies();
  deliver(second, one, {1}, 2);
  EXPECT_EQ(outbox.take_stored(), Runs{{1}});
  EXPECT_EQ(wire::ranges_of(outbox.take_sent<proto::Retract>(first).ranges()), (Ranges{{{1}, 1}}));
  deliver(first, one, {1});
  EXPECT_EQ(outbox.take_compared(), Runs{{1}});
  EXPECT_EQ(campaign(one).num_duplicates, 1U);
  outbox.forget();
}

// Otherwise a run that hangs would go from copy to copy, and never be tried alone.
TEST_F(TailTest, ASuspectHasNoCopies) {
  begin_copies();
  crash(first);
  EXPECT_EQ(campaign(one).pending_suspects.size(), 2U);
  EXPECT_TRUE(campaign(one).copies.empty());
  EXPECT_EQ(state.workers.at(second).unleased.at(one).size(), 2U);
  outbox.forget();
}

TEST_F(TailTest, ARunThatCrashedItsCopyIsNotCopiedAgain) {
  begin_copies();
  crash(second);
  ASSERT_EQ(campaign(one).suspects.size(), 2U);
  outbox.forget();
  add_worker(third, 2);
  on_tick(state, now, outbox);
}

// A heartbeat from before the copies arrived must not make the worker look idle: the suspect would
// be blamed for what it is computed with.
TEST_F(TailTest, ACopyThatMayStillArriveKeepsSuspectsAway) {
  begin_copies();
  crash(first);
  outbox.forget();
  now += 11s;
  heartbeat(second);
  outbox.expect_nothing_more();
  now += 1s;
  heartbeat(second);
  EXPECT_TRUE(outbox.take_sent<proto::RunLease>(second).is_alone());
}

}  // namespace
}  // namespace proofmass::test
