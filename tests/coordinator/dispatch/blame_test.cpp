// What counts against a run or a host, and what follows.

#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

class BlameTest : public DispatchFixture {
 protected:
  std::vector<RunIndex> suspects() {
    std::vector<RunIndex> runs;
    for (const auto& [run, suspicion] : campaign(one).suspects) runs.push_back(run);
    return runs;
  }

  static proto::ComputedBatch batch(RunRange runs, std::uint32_t num_steps_done = 0) {
    return make_computed_batch(one, {runs}, num_steps_done);
  }

  /// Run 0 of campaign one; run 1 is finished, and the first worker is there again.
  void crash_three_times_on_one_host() {
    add_campaign(one, 2);
    add_busy_worker(first);
    state.hosts.at({"", "host"}).num_results = 1;  // It has shown that it can compute.
    for (int i = 0; i < 3; ++i) {
      crash(first);
      EXPECT_TRUE(campaign(one).given_up.empty());
      add_busy_worker(first);
      if (i == 0) complete(first, one, {1});
    }
    EXPECT_TRUE(state.leases.empty()) << "it waits for another host";
  }
};

TEST_F(BlameTest, ACrashCountsAgainstWhatWasComputed) {
  add_campaign(one, 10);
  add_worker(first, 4);
  heartbeat(first, {held(one, {{0}, 4})}, {batch({{1}, 2})});
  outbox.forget();
  on_gone(state, first, LossReason::out_of_memory, now, outbox);
  EXPECT_EQ(suspects(), (Runs{{1}, {2}}));
  EXPECT_EQ(outbox.take_events(),
            (Strings{"worker_gone worker=1 name=w reason=out_of_memory steps=0",
                     "runs_lost worker=1 runs=0..3 attempt=1 reason=out_of_memory blamed=1..2"}));
  const auto losses = outbox.take_losses();
  ASSERT_EQ(losses.size(), 3U);
  EXPECT_EQ(losses[0].runs, (RunRange{{1}, 2}));
  EXPECT_TRUE(losses[0].is_blamed);
  EXPECT_FALSE(losses[1].is_blamed || losses[2].is_blamed);
}

TEST_F(BlameTest, WithoutAHeartbeatTheFirstSlotsWereComputed) {
  add_campaign(one, 100);
  add_worker(first, 2);
  complete(first, one, {0});
  ASSERT_EQ(runs_held_text(state, first), "1..4");
  crash(first);
  EXPECT_EQ(suspects(), (Runs{{1}, {2}}));
  outbox.forget();
}

TEST_F(BlameTest, OtherLossesCountAgainstNothing) {
  for (const LossReason reason : {LossReason::silent, LossReason::protocol, LossReason::failed}) {
    const CampaignId id{500 + static_cast<std::uint64_t>(reason)};
    add_campaign(id, 1);
    add_worker(first);
    on_gone(state, first, reason, now, outbox);
    EXPECT_TRUE(campaign(id).suspects.empty());
    on_cancel(state, id, outbox);
  }
  outbox.forget();
}

TEST_F(BlameTest, ASuspectIsLentAloneAfterAllOthers) {
  add_campaign(one, 6);
  add_busy_worker(first, 2);
  crash(first);
  ASSERT_EQ(suspects(), (Runs{{0}, {1}}));
  outbox.forget();

  add_worker(second, 4);
  const auto others = outbox.take_sent<proto::RunLease>(second);
  EXPECT_EQ(wire::runs_of(others), (RunRange{{2}, 4}));
  EXPECT_FALSE(others.is_alone());
  deliver(second, one, {2, 3, 4});
  EXPECT_EQ(outbox.num_sent(), 0U) << "a suspect waits until the worker is idle";
  deliver(second, one, {5});
  const auto suspect = outbox.take_sent<proto::RunLease>(second);
  EXPECT_EQ(wire::runs_of(suspect), (RunRange{{0}, 1}));
  EXPECT_TRUE(suspect.is_alone());
  EXPECT_EQ(suspect.attempt(), 2U);
  add_campaign(two, 1);
  EXPECT_EQ(outbox.num_sent(), 0U) << "a worker with a suspect has nothing else";
  outbox.forget();
}

TEST_F(BlameTest, ARunThatCrashesAloneOnTwoHostsIsGivenUp) {
  crash_three_times_on_one_host();
  add_busy_worker(second, 1, "other");
  crash(second);
  EXPECT_EQ(outbox.take_given_up(), Runs{{0}});
  EXPECT_TRUE(is_finished(campaign(one)));
  EXPECT_EQ(state.hosts.at({"", "host"}).num_crashes, 0U) << "the run was the cause";
  const Strings events = outbox.take_events();
  EXPECT_EQ(events.at(2), "run_given_up run=0 crashes=4");
  EXPECT_EQ(events.at(3), "campaign_finished runs=2 given_up=1 duplicates=0 compared=0");
  outbox.forget();
}

// The worker may say so, and start again under other names.
TEST_F(BlameTest, ARunThatOneHostAloneSawCrashWaitsForAnother) {
  crash_three_times_on_one_host();
  add_worker(second, 1, "other");
  deliver(second, one, {0});
  EXPECT_EQ(outbox.take_stored(), Runs{{0}});
  EXPECT_TRUE(campaign(one).given_up.empty());
  outbox.forget();
}

TEST_F(BlameTest, ARunIsGivenUpIfNoOtherHostTriesItForLong) {
  crash_three_times_on_one_host();
  for (int i = 0; i <= 10; ++i) {
    EXPECT_TRUE(campaign(one).given_up.empty()) << i;
    heartbeat(first);
    on_tick(state, now, outbox);
    now += 30s;
  }
  EXPECT_EQ(outbox.take_given_up(), Runs{{0}});
  outbox.forget();
}

// What the service computes besides says nothing about the run.
TEST_F(BlameTest, ARunIsGivenUpAlsoWhereTheHostComputesAnotherCampaign) {
  crash_three_times_on_one_host();
  add_campaign(two, 10);
  heartbeat(first);
  EXPECT_FALSE(state.leases.empty());
  for (int i = 0; i <= 10; ++i) {
    EXPECT_TRUE(campaign(one).given_up.empty()) << i;
    heartbeat(first, {held(two, {{0}, 10})});
    on_tick(state, now, outbox);
    now += 30s;
  }
  EXPECT_EQ(outbox.take_given_up(), Runs{{0}});
  outbox.forget();
}

TEST_F(BlameTest, ARunIsNotGivenUpWhileAHostThatMayTryItIsBusy) {
  crash_three_times_on_one_host();
  constexpr int high_priority = 1;
  add_campaign(two, 10, high_priority);
  add_worker(second, 1, "other");
  for (int i = 0; i <= 20; ++i) {
    heartbeat(first);
    heartbeat(second, {held(two, {{0}, 10})});
    on_tick(state, now, outbox);
    now += 30s;
  }
  EXPECT_TRUE(campaign(one).given_up.empty());
  outbox.forget();
}

TEST_F(BlameTest, OnlyACrashAloneTellsAgainstASuspect) {
  add_campaign(one, 3);
  add_worker(first, 3);
  const auto count = [&](std::uint64_t run) {
    const auto& suspicion = campaign(one).suspects.at({run});
    return std::pair(suspicion.num_crashes, suspicion.hosts.at({"", "host"}).num_alone);
  };
  crash(first);
  for (const std::uint64_t run : {0U, 1U, 2U}) EXPECT_EQ(count(run), std::pair(1U, 0U));
  add_busy_worker(first, 3);
  ASSERT_EQ(runs_held_text(state, first), "0");

  // It turns out to hold a run that was lent to another worker: that may be the cause as well.
  add_worker(second, 3);
  ASSERT_EQ(runs_held_text(state, second), "1");
  heartbeat(first, {held(one, {{0}, 2}, 2)});
  crash(first);
  EXPECT_EQ(count(0), std::pair(1U, 0U));

  crash(second);
  EXPECT_EQ(count(1), std::pair(2U, 1U));
  EXPECT_EQ(count(2), std::pair(1U, 0U));
  outbox.forget();
}

// Otherwise it would be blamed for what the worker still computes of that campaign.
TEST_F(BlameTest, ASuspectWaitsUntilAWorkerHasForgottenACancelledCampaign) {
  add_campaign(one, 1);
  add_worker(first);
  crash(first);
  add_campaign(two, 1, 5);
  outbox.forget();
  add_worker(second);
  ASSERT_EQ(outbox.take_sent<proto::RunLease>(second).campaign(), two.value);
  on_cancel(state, two, outbox);
  outbox.forget();
  heartbeat(second, {held(two, {{0}, 1})});
  EXPECT_EQ(outbox.take_sent<proto::Forget>(second).campaign(), two.value);
  outbox.expect_nothing_more();

  now += 11s;
  heartbeat(second);  // It may have been sent before the lease arrived.
  outbox.expect_nothing_more();
  now += 1s;
  heartbeat(second);
  EXPECT_TRUE(outbox.take_sent<proto::RunLease>(second).is_alone());
}

TEST_F(BlameTest, ASuspectIsTriedOnAnotherHost) {
  add_campaign(one, 1);
  add_worker(first, 1, "bad");
  crash(first);
  outbox.forget();
  add_worker(second, 1, "good");
  (void)outbox.take_sent<proto::RunLease>(second);
  heartbeat(second, {held(one, {{0}, 1}, 2)}, {}, 0);  // Takes nothing more now.
  give_back(second, held(one, {{0}, 1}, 2));
  outbox.forget();
  ASSERT_EQ(campaign(one).pending_suspects.size(), 1U);
  add_worker(first, 1, "bad");
  EXPECT_EQ(outbox.num_sent(), 0U);
  outbox.forget();
}

TEST_F(BlameTest, FiveCrashesInARowQuarantineAHostAndItsBlameIsWithdrawn) {
  add_campaign(one, 100);
  for (int i = 0; i < 4; ++i) {
    add_worker(first, 2, "bad");
    crash(first);
  }
  ASSERT_EQ(suspects().size(), 8U);
  outbox.forget();
  add_busy_worker(first, 2, "bad");
  crash(first);
  EXPECT_TRUE(suspects().empty());
  EXPECT_TRUE(campaign(one).pending_suspects.empty());
  EXPECT_TRUE(is_quarantined(state, "bad"));
  EXPECT_EQ(outbox.take_events(),
            (Strings{"worker_gone worker=1 name=w reason=crashed steps=0",
                     "host_quarantined host=bad crashes=5 address=bad",
                     "runs_lost worker=1 runs=8..9 attempt=1 reason=crashed"}));
  EXPECT_FALSE(outbox.take_losses().at(0).is_blamed);

  say_hello(second, hello(1, "bad"));
  const auto reject = outbox.take_sent<proto::Reject>(second);
  EXPECT_EQ(reject.reason(), proto::REJECT_REASON_QUARANTINED);
  EXPECT_EQ(reject.text(), "host = bad (too much crashed there)");
  (void)outbox.take_events();
}

TEST_F(BlameTest, AWorkerOnAQuarantinedHostIsLentNothingButMayDeliver) {
  add_campaign(one, 3);
  add_worker(first);
  state.quarantined[{"", "host"}] = now + 10min;
  outbox.forget();
  heartbeat(first, {held(one, {{0}, 1})});
  EXPECT_EQ(runs_held_text(state, first), "0");
  deliver(first, one, {0});
  EXPECT_EQ(outbox.take_stored(), Runs{{0}});
  outbox.forget();
}

TEST_F(BlameTest, AWorkerOnAQuarantinedHostThatHasDeliveredIsLentARoundAtATime) {
  add_campaign(one, 100);
  add_worker(first, 2);
  complete(first, one, {0, 1});
  state.quarantined[{"", "host"}] = now + 10min;
  complete(first, one, {2, 3, 4, 5});
  EXPECT_EQ(state.workers.at(first).num_lent, 2U);
}

TEST_F(BlameTest, AQuarantineEndsByItself) {
  add_campaign(one, 100);
  for (int i = 0; i < 5; ++i) {
    add_worker(first, 2, "bad");
    crash(first);
  }
  outbox.forget();
  now += 10min;
  on_tick(state, now, outbox);
  EXPECT_EQ(outbox.take_events(), Strings{"host_released host=bad"});
  add_worker(first, 2, "bad");
  EXPECT_EQ(state.workers.at(first).num_lent, 2U);
  outbox.forget();
}

TEST_F(BlameTest, AResultEndsARowOfCrashes) {
  add_campaign(one, 100);
  for (int i = 0; i < 8; ++i) {
    add_worker(first);
    if (i == 4) complete(first, one, {50});
    crash(first);
    outbox.forget();
  }
  EXPECT_TRUE(state.quarantined.empty());
  EXPECT_EQ(state.hosts.at({"", "host"}).num_crashes, 4U);
}

// A host on which nothing has ever finished is as likely the cause as the run.
TEST_F(BlameTest, ARunIsNotGivenUpOnTheWordOfOneUnprovenHost) {
  add_campaign(one, 1);
  for (int i = 0; i < 4; ++i) {
    add_worker(first);
    crash(first);
    outbox.forget();
  }
  EXPECT_TRUE(campaign(one).given_up.empty());
  add_busy_worker(second, 1, "other");
  crash(second);  // Alone, and elsewhere.
  EXPECT_EQ(outbox.take_given_up(), Runs{{0}});
  outbox.forget();
}

TEST_F(BlameTest, ABatchThatComesNoFurtherIsHung) {
  add_campaign(one, 10);
  add_worker(first, 4);
  state.hosts.at({"", "host"}).step_time_s[one] = 0.1;
  for (std::uint32_t i = 0; i <= 12; ++i, now += 5s) {
    heartbeat(first, {held(one, {{0}, 4})}, {batch({{0}, 2}, 7), batch({{2}, 2}, 50 * i)});
    outbox.forget();
    if (i == 12) break;
    on_tick(state, now, outbox);
    ASSERT_TRUE(state.workers.contains(first)) << i;
  }
  state.is_behind = true;
  on_tick(state, now, outbox);
  EXPECT_TRUE(state.workers.contains(first)) << "its last heartbeats may wait to be read";
  state.is_behind = false;
  on_tick(state, now, outbox);  // A minute without a step.
  (void)outbox.take_sent<proto::Stop>(first);
  EXPECT_EQ(suspects(), (Runs{{0}, {1}}));
  EXPECT_EQ(outbox.take_events().at(0),
            "worker_gone worker=1 name=w reason=hung runs=0..1 steps=7");
  EXPECT_EQ(outbox.take_losses().at(0).reason, LossReason::hung);
  outbox.forget();
}

TEST_F(BlameTest, ASlowCampaignIsNotHung) {
  add_campaign(one, 10);
  add_worker(first);
  state.hosts.at({"", "host"}).step_time_s[one] = 10.0;  // Then 500 s are allowed.
  for (int i = 0; i < 99; ++i) {
    heartbeat(first, {held(one, {{0}, 1})}, {batch({{0}, 1})});
    on_tick(state, now, outbox);
    outbox.forget();
    now += 5s;
  }
  EXPECT_TRUE(state.workers.contains(first));
}

TEST_F(BlameTest, AProcessThatWasStoppedForAWhileIsNotHung) {
  add_campaign(one, 10);
  add_worker(first);
  state.hosts.at({"", "host"}).step_time_s[one] = 0.1;
  heartbeat(first, {held(one, {{0}, 1})}, {batch({{0}, 1}, 5)});
  now += 59s;
  heartbeat(first, {held(one, {{0}, 1})}, {batch({{0}, 1}, 5)});
  now += 5s;
  heartbeat(first, {held(one, {{0}, 1})}, {batch({{0}, 1}, 5)});
  on_tick(state, now, outbox);
  EXPECT_TRUE(state.workers.contains(first));
  outbox.forget();
}

// Whether it is silent or only its heartbeats do not arrive.
TEST_F(BlameTest, OfAWorkerWithoutHeartbeatsNothingIsKnown) {
  for (const bool delivers : {false, true}) {
    begin();
    add_campaign(one, 10);
    add_worker(first, 2);
    state.hosts.at({"", "host"}).step_time_s[one] = 0.1;
    for (int i = 0; i < 10; ++i, now += 5s) {
      heartbeat(first, {held(one, {{0}, 2})}, {batch({{0}, 1}, 5)});
    }
    now += 20s;
    if (delivers) deliver(first, one, {1});
    on_tick(state, now, outbox);
    EXPECT_TRUE(state.workers.contains(first)) << delivers;
    outbox.forget();
  }
}

TEST_F(BlameTest, TheTimeOfAStepIsLearnedFromHeartbeats) {
  add_campaign(one, 10);
  add_busy_worker(first);
  heartbeat(first, {held(one, {{0}, 1})}, {batch({{0}, 1}, 5)});
  now += 5s;
  heartbeat(first, {held(one, {{0}, 1})}, {batch({{0}, 1}, 15)});
  EXPECT_DOUBLE_EQ(state.hosts.at({"", "host"}).step_time_s[one], 0.5);
}

TEST_F(BlameTest, BlameOutlivesTheCoordinator) {
  StoredCampaign stored = stored_campaign(3);
  stored.finished = {{{1}, 2}};
  stored.blamed = {{.run = {0}, .num_crashes = 7, .attempt = {4}},
                   {.run = {1}, .num_crashes = 1, .attempt = {1}}};
  on_campaign(state, one, stored, now, outbox);
  EXPECT_EQ(suspects(), Runs{{0}});
  EXPECT_EQ(campaign(one).suspects.at({0}).num_crashes, 2U) << "one more crash is needed";
  add_worker(first);
  const auto lease = outbox.take_sent<proto::RunLease>(first);
  EXPECT_TRUE(lease.is_alone());
  EXPECT_EQ(lease.attempt(), 5U);
}

TEST_F(BlameTest, ASuspectThatIsAllAWorkerHoldsGoesOnThere) {
  StoredCampaign stored = stored_campaign(2);
  stored.finished = {{{1}, 1}};
  stored.blamed = {{.run = {0}, .num_crashes = 1, .attempt = {1}}};
  on_campaign(state, one, stored, now, outbox);
  say_hello(first, hello());
  outbox.forget();
  heartbeat(first, {held(one, {{0}, 1}, 2)});
  EXPECT_TRUE(state.leases.at(*campaign(one).lent.find({0})).is_alone);
  EXPECT_EQ(state.workers.at(first).num_alone, 1U);
}

// A claim counts as a lease: one worker once kept a run from its end for ever.
TEST_F(BlameTest, ASuspectIsClaimedAgainAndAgain) {
  crash_three_times_on_one_host();
  add_worker(second, 1, "liar");
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(runs_held_text(state, second), "0") << i;
    on_bye(state, second, LossReason::failed, now, outbox);
    say_hello(second, hello(1, "liar"));
    heartbeat(second, {held(one, {{0}, 1}, 9)});
  }
  EXPECT_EQ(runs_held_text(state, second), "none") << "it has tried often enough";
  const TimePoint claimed_at = now;
  while (campaign(one).given_up.empty() && now - claimed_at < 1h) {
    now += 5s;
    heartbeat(first);
    heartbeat(second, {held(one, {{0}, 1}, 9)});
    on_tick(state, now, outbox);
  }
  EXPECT_EQ(now - claimed_at, 5min);
  outbox.forget();
}

}  // namespace
}  // namespace proofmass::test
