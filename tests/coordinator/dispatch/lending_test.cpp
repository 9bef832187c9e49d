#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

// How much a worker is lent at a time.

class LendingTest : public DispatchFixture {
 protected:
  /// Runs that a worker holds after it delivered the first run.
  std::string lent_after_first_run(std::uint64_t num_runs, double run_time_s,
                                   std::uint32_t num_runs_max = 4096) {
    begin();
    state.config.uncommitted_max = uncommitted_max;
    add_campaign(one, num_runs);
    add_worker(first);
    EXPECT_EQ(taken_lease(first), (RunRange{{0}, 1})) << "how long a run takes is not known yet";
    heartbeat(first, {held(one, {{0}, 1})}, {}, num_runs_max);
    wire::ComputedRun result = computed(0);
    result.elapsed_s = run_time_s;
    on_results(state, first, one, {1}, {result}, now, outbox);
    outbox.forget();
    check_invariants(state);
    return runs_held_text(state, first);
  }

  std::uint64_t uncommitted_max = config.uncommitted_max;
};

TEST_F(LendingTest, GivesASecondAndAHalfOfWorkWithinItsLimits) {
  EXPECT_EQ(lent_after_first_run(1'000'000, 0.01), "1..150");
  EXPECT_EQ(lent_after_first_run(1'000'000, 60.0), "1..2") << "one to compute and one to wait";
  EXPECT_EQ(lent_after_first_run(1'000'000, 0.0), "1..4096") << "what a lease may have";
  EXPECT_EQ(lent_after_first_run(1'000'000, 0.01, 20), "1..20") << "the credit";
  EXPECT_EQ(lent_after_first_run(1'000'000, 0.01, 0), "none") << "no credit";
  EXPECT_EQ(lent_after_first_run(101, 0.001), "1..50") << "half of a fair share near the end";
  uncommitted_max = 200;
  EXPECT_EQ(lent_after_first_run(1'000'000, 0.01), "1..99") << "half of the room, after one result";
}

// A card computes more runs at a time than a lease may have.
TEST_F(LendingTest, GivesManySlotsSeveralLeases) {
  add_campaign(one, 100'000);
  say_hello(first, hello(10'000));
  outbox.drop_sent<proto::Welcome>(first);
  (void)outbox.take_events();
  heartbeat(first, {}, {}, 20'000);
  for (const RunRange& runs : {RunRange{{0}, 4096}, {{4096}, 4096}, {{8192}, 1808}}) {
    EXPECT_EQ(taken_lease(first), runs);
  }
  check_invariants(state);
}

// 1,000 columns of 1,000 runs are 8 MB, and half of a message has room for 262 runs.
TEST_F(LendingTest, SendsNoMoreTableValuesThanAMessageHolds) {
  MicroscopeCampaign campaign;
  campaign.num_runs = 1000;
  campaign.table_columns.assign(1000, std::vector<double>(1000, 0.5));
  on_campaign(state, one, {.definition = std::make_shared<const MicroscopeCampaign>(campaign)}, now,
              outbox);
  say_hello(first, hello(1000));
  outbox.drop_sent<proto::Welcome>(first);
  (void)outbox.take_events();
  heartbeat(first);
  std::uint64_t end = 0;
  for (const std::uint32_t count : {262U, 262U, 262U, 214U}) {
    const auto lease = outbox.take_sent<proto::RunLease>(first);
    EXPECT_EQ(lease.first_run(), end);
    EXPECT_EQ(lease.num_runs(), count);
    EXPECT_EQ(lease.table_values_size(), static_cast<int>(1000 * count));
    EXPECT_LT(lease.ByteSizeLong(), wire::message_size_max);
    end += count;
  }
}

TEST_F(LendingTest, GivesNothingWhileTooManyResultsWaitForTheStore) {
  state.config.uncommitted_max = 4;
  add_campaign(one, 100);
  add_worker(first, 2);
  EXPECT_EQ(taken_lease(first), (RunRange{{0}, 2}));
  deliver(first, one, {0, 1});
  EXPECT_EQ(runs_held_text(state, first), "none");
  commit(one);
  outbox.drop_sent<proto::ResultAck>(first);
  EXPECT_EQ(taken_lease(first), (RunRange{{2}, 4})) << "two rounds, however small the room";
}

TEST_F(LendingTest, GivesLessThanARoundIfResultsWouldComeFasterThanTheyCanBeTaken) {
  state.config.uncommitted_max = 8;
  state.config.results_per_s_max = 10.0;
  state.config.run_time_s_expected = 0.5;
  add_campaign(one, 1'000'000);
  add_worker(first, 64);
  EXPECT_EQ(taken_lease(first), (RunRange{{0}, 10})) << "two rounds' time";
  wire::ComputedRun result = computed(0);
  result.elapsed_s = 2.0;
  on_results(state, first, one, {1}, {result}, now, outbox);
  (void)outbox.take_stored();
  EXPECT_EQ(taken_lease(first), (RunRange{{10}, 31}));
  EXPECT_EQ(runs_held_text(state, first), "1..40");
  add_worker(second, 64);
  EXPECT_EQ(taken_lease(second), (RunRange{{41}, 20})) << "half of it";
}

TEST_F(LendingTest, TakesNothingFromOthersForAWorkerThatWaitsForTheStore) {
  EXPECT_EQ(lent_after_first_run(1'000'000, 0.01), "1..150");
  add_worker(second);
  EXPECT_EQ(taken_lease(second), (RunRange{{151}, 150}));
  state.config.uncommitted_max = 2;
  for (std::uint64_t run = 151; run <= 300; ++run) deliver(second, one, {run});
  (void)outbox.take_stored();
  on_tick(state, now, outbox);
  EXPECT_EQ(runs_held_text(state, second), "none");
}

TEST_F(LendingTest, GivesNothingMoreWhenCreditIsRepeated) {
  add_campaign(one, 100);
  add_worker(first);
  (void)outbox.take_sent<proto::RunLease>(first);
  heartbeat(first, {held(one, {{0}, 1})});
}

TEST_F(LendingTest, SharesTheLastRunsAmongAllWorkers) {
  for (const WorkerId id : {first, second, third}) add_worker(id, 32);
  add_campaign(one, 40);
  const auto lease = outbox.take_sent<proto::RunLease>(first);
  EXPECT_EQ(wire::runs_of(lease), (RunRange{{0}, 14}));
  EXPECT_EQ(lease.batch_runs_max(), 7U) << "as there are two threads";
  EXPECT_EQ(taken_lease(second), (RunRange{{14}, 13}));
  EXPECT_EQ(taken_lease(third), (RunRange{{27}, 13}));
}

TEST_F(LendingTest, SharesNoRunsThatFillMoreThanHalfOfTheSlots) {
  for (const WorkerId id : {first, second, third}) add_worker(id, 16);
  add_campaign(one, 25);
  const auto lease = outbox.take_sent<proto::RunLease>(first);
  EXPECT_EQ(wire::runs_of(lease), (RunRange{{0}, 16}));
  EXPECT_EQ(lease.batch_runs_max(), 0U);
  EXPECT_EQ(taken_lease(second), (RunRange{{16}, 5}));
  EXPECT_EQ(taken_lease(third), (RunRange{{21}, 4}));
}

TEST_F(LendingTest, GivesAnEighthOfARoundOfTheLastRunsAtLeast) {
  for (const WorkerId id : {first, second, third}) add_worker(id, 16);
  add_campaign(one, 3);
  EXPECT_EQ(taken_lease(first), (RunRange{{0}, 2}));
  EXPECT_EQ(taken_lease(second), (RunRange{{2}, 1}));
}

TEST_F(LendingTest, LeavesTheLastRunsToWorkersThatAreStillToCome) {
  state.num_slots_expected = 64;
  add_campaign(one, 20);
  add_worker(first, 16);
  EXPECT_EQ(taken_lease(first), (RunRange{{0}, 5}));
}

// One wants nothing, one is silent, and one is on a host where workers crash.
TEST_F(LendingTest, LeavesNoneOfTheLastRunsToWorkersThatAreLentNothing) {
  constexpr WorkerId fourth{4};
  add_worker(first, 16);
  add_worker(second, 160);
  add_worker(third, 160);
  now += state.config.suspect_after;
  add_worker(fourth, 160, "bad");
  state.quarantined[state.workers.at(fourth).host] = now + std::chrono::minutes(10);
  heartbeat(first);
  heartbeat(second, {}, {}, 0);
  on_tick(state, now, outbox);
  add_campaign(one, 40);
  const auto lease = outbox.take_sent<proto::RunLease>(first);
  EXPECT_EQ(wire::runs_of(lease), (RunRange{{0}, 16}));
  EXPECT_EQ(lease.batch_runs_max(), 0U);
  heartbeat(third);
  const auto second_lease = outbox.take_sent<proto::RunLease>(third);
  EXPECT_EQ(wire::runs_of(second_lease), (RunRange{{16}, 24}));
  EXPECT_EQ(second_lease.batch_runs_max(), 3U) << "its ten threads count again, as it is heard";
}

TEST_F(LendingTest, ExpectsNoMoreSlotsOnceAWorkerIsLost) {
  state.num_slots_expected = 64;
  add_worker(first, 16);
  add_worker(second, 16);
  EXPECT_EQ(state.num_slots_expected, 32U);
  on_bye(state, second, LossReason::preempted, now, outbox);
  outbox.forget();
  EXPECT_EQ(state.num_slots_expected, 0U);
  add_campaign(one, 20);
  EXPECT_EQ(taken_lease(first), (RunRange{{0}, 16}));
}

TEST_F(LendingTest, SharesNothingWhileAnotherCampaignHasRuns) {
  for (const WorkerId id : {first, second}) add_worker(id, 16);
  state.is_lending = false;
  add_campaign(one, 8);
  add_campaign(two, 100);
  state.is_lending = true;
  heartbeat(first);
  EXPECT_EQ(taken_lease(first), (RunRange{{0}, 8}));
  const auto lease = outbox.take_sent<proto::RunLease>(first);
  EXPECT_EQ(lease.campaign(), two.value);
  EXPECT_EQ(wire::runs_of(lease), (RunRange{{0}, 8}));
  heartbeat(second);
  EXPECT_EQ(taken_lease(second), (RunRange{{8}, 16}));
}

// The other thread of the worker computes eight runs and has no room for more.
TEST_F(LendingTest, GivesTheLastRunsToAnIdleThread) {
  add_worker(first, 32);
  add_worker(second, 16);
  add_campaign(one, 23);
  outbox.forget();
  EXPECT_EQ(runs_held_text(state, first), "0..15");
  deliver(first, one, {0, 1, 2, 3, 4, 5, 6, 7});
  EXPECT_EQ(state.num_idle_slots, 16U);
  on_bye(state, second, LossReason::preempted, now, outbox);
  outbox.forget();
  EXPECT_EQ(runs_held_text(state, first), "8..22");
  EXPECT_EQ(state.num_idle_slots, 0U);
}

// Slots that were lent runs long ago will be idle soon. Those that were lent some just now will
// not.
TEST_F(LendingTest, SharesTheLastRunsAmongWorkersThatWillSoonBeIdle) {
  for (const WorkerId id : {first, second}) add_worker(id, 16);
  add_campaign(one, 46);
  outbox.forget();
  now += std::chrono::seconds(600);
  complete(first, one, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15});
  EXPECT_EQ(runs_held_text(state, first), "32..38");
  now += std::chrono::seconds(600);
  complete(first, one, {32, 33, 34, 35, 36, 37, 38});
  EXPECT_EQ(runs_held_text(state, first), "39..42");
}

// A batch of two runs takes less time than one of sixteen: a run would be taken for overdue.
TEST_F(LendingTest, LearnsTheTimeOfARunFromBatchesThatAreNotShort) {
  add_worker(first, 16);
  add_campaign(one, 18);
  outbox.forget();
  const auto deliver_after = [&](std::uint64_t begin, std::uint64_t end, double elapsed_s) {
    std::vector<wire::ComputedRun> results;
    for (std::uint64_t run = begin; run < end; ++run) {
      results.push_back(computed(run));
      results.back().elapsed_s = elapsed_s;
    }
    on_results(state, first, one, {1}, std::move(results), now, outbox);
    outbox.forget();
  };
  deliver_after(0, 16, 1000.0);
  EXPECT_EQ(runs_held_text(state, first), "16..17");
  deliver_after(16, 18, 300.0);
  EXPECT_EQ(campaign(one).run_time_s, 1000.0);
  add_campaign(two, 2);
  outbox.forget();
  wire::ComputedRun only = computed(0);
  only.elapsed_s = 300.0;
  on_results(state, first, two, {1}, {only}, now, outbox);
  outbox.forget();
  EXPECT_EQ(campaign(two).run_time_s, 300.0) << "nothing else is known";
}

// Runs that a lost worker held come before those that were never lent.
TEST_F(LendingTest, GivesRunsThatWereLentBeforeFirst) {
  add_campaign(one, 10);
  add_worker(first, 3);
  on_bye(state, first, LossReason::preempted, now, outbox);
  outbox.forget();
  add_worker(second, 4);
  const auto again = outbox.take_sent<proto::RunLease>(second);
  EXPECT_EQ(wire::runs_of(again), (RunRange{{0}, 3}));
  EXPECT_EQ(again.attempt(), 2U);
  const auto fresh = outbox.take_sent<proto::RunLease>(second);
  EXPECT_EQ(wire::runs_of(fresh), (RunRange{{3}, 1}));
  EXPECT_EQ(fresh.attempt(), 1U);
}

// Ranges that do not touch are one lease to the dispatch, and a message each.
TEST_F(LendingTest, GivesSeveralRangesAtATime) {
  StoredCampaign stored = stored_campaign(6);
  stored.finished = {{{1}, 1}, {{3}, 1}};
  on_campaign(state, one, stored, now, outbox);
  add_worker(first, 4);
  EXPECT_EQ(taken_lease(first), (RunRange{{0}, 1}));
  EXPECT_EQ(taken_lease(first), (RunRange{{2}, 1}));
  EXPECT_EQ(taken_lease(first), (RunRange{{4}, 2}));
  EXPECT_EQ(state.leases.size(), 1U);
}

// The end of a campaign: idle workers get a part of what others have.

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
  EXPECT_EQ(taken_back(first), (Ranges{{{3}, 2}}));
  give_back(first, held(one, {{3}, 2}));
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
