#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

// Workers that come, say that they live, and go.

class WorkerTest : public DispatchFixture {
 protected:
  void refuse(const proto::Hello& said, proto::RejectReason reason, const std::string& text) {
    const std::uint64_t num_refusals_before = state.num_refusals;
    say_hello(second, said);
    const auto reject = outbox.take_sent<proto::Reject>(second);
    EXPECT_EQ(reject.reason(), reason);
    EXPECT_EQ(reject.text(), text);
    EXPECT_EQ(outbox.take_events(), Strings{"worker_refused name=w reason=\"" + text + "\""});
    EXPECT_FALSE(state.workers.contains(second));
    EXPECT_EQ(state.num_refusals, num_refusals_before + 1);
    EXPECT_EQ(state.last_refusal, "w: " + text);
  }
};

TEST_F(WorkerTest, IsAnsweredAgainAndKeepsItsLeases) {
  add_campaign(one, 10);
  add_worker(first);
  (void)outbox.take_sent<proto::RunLease>(first);
  say_hello(first, hello());
  (void)outbox.take_sent<proto::Welcome>(first);
  EXPECT_EQ(state.leases.size(), 1U);
  EXPECT_EQ(state.num_slots, 1U);
}

TEST_F(WorkerTest, IsRefusedWithAnotherModel) {
  proto::Hello other = hello();
  other.set_model_version("older");
  refuse(other, proto::REJECT_REASON_INCOMPATIBLE,
         "model_version = older (must be " + std::string(model_version) + ", the coordinator's)");
}

TEST_F(WorkerTest, IsRefusedIfItComputesOtherBits) {
  config.reference_digest = 0xabcdef;
  begin();
  refuse(hello(), proto::REJECT_REASON_INCOMPATIBLE,
         "reference_digest = 0000000000000000 (must be 0000000000abcdef, the coordinator's)");
}

TEST_F(WorkerTest, IsRefusedBeyondTheNumberThatIsServed) {
  config.num_workers_max = 1;
  begin();
  add_worker(first);
  refuse(hello(), proto::REJECT_REASON_FULL, "number of workers = 1 (no more are served)");
}

TEST_F(WorkerTest, IsNotAnsweredIfTooManySayHello) {
  config.hellos_per_s_max = 2.0;
  begin();
  for (int i = 0; i < 5; ++i) {
    say_hello(first, hello());
  }
  (void)outbox.take_sent<proto::Welcome>(first);
  (void)outbox.take_sent<proto::Welcome>(first);
  (void)outbox.take_events();
  outbox.expect_nothing_more();
  now += 500ms;
  say_hello(first, hello());
  (void)outbox.take_sent<proto::Welcome>(first);
}

TEST_F(WorkerTest, IsLentNothingBeforeItHasSaidWhatItHolds) {
  add_campaign(one, 1);
  say_hello(first, hello());
  (void)outbox.take_sent<proto::Welcome>(first);
  (void)outbox.take_events();
  on_tick(state, now, outbox);
  outbox.expect_nothing_more();
  heartbeat(first);
  EXPECT_EQ(taken_lease(first), (RunRange{{0}, 1}));
}

TEST_F(WorkerTest, AnOlderHeartbeatChangesNothing) {
  add_campaign(one, 1);
  add_busy_worker(first);
  now += 1h;
  on_heartbeat(state, first, make_heartbeat(0), sequence, now, outbox);
  (void)outbox.take_sent<proto::HeartbeatAck>(first);
  EXPECT_EQ(state.workers.at(first).num_runs_max, 4096U);
  EXPECT_EQ(state.leases.size(), 1U);
}

TEST_F(WorkerTest, ThatIsSilentLosesItsRunsWhichAreLentAgainUnderAHigherAttempt) {
  add_campaign(one, 1);
  add_worker(first);
  (void)outbox.take_sent<proto::RunLease>(first);
  now += 59s;
  on_tick(state, now, outbox);
  outbox.expect_nothing_more();

  now += 1s;
  on_tick(state, now, outbox);
  EXPECT_FALSE(state.workers.contains(first));
  EXPECT_EQ(outbox.take_events(), (Strings{"worker_gone worker=1 name=w reason=silent steps=0",
                                           "runs_lost worker=1 runs=0 attempt=1 reason=silent"}));
  const auto losses = outbox.take_losses();
  ASSERT_EQ(losses.size(), 1U);
  EXPECT_EQ(losses[0].campaign, one);
  EXPECT_EQ(losses[0].runs, (RunRange{{0}, 1}));
  EXPECT_EQ(losses[0].attempt, Attempt{1});
  EXPECT_EQ(losses[0].worker, session_of(first));
  EXPECT_EQ(losses[0].reason, LossReason::silent);
  EXPECT_FALSE(losses[0].is_blamed);
  add_worker(second);
  const auto lease = outbox.take_sent<proto::RunLease>(second);
  EXPECT_EQ(wire::runs_of(lease), (RunRange{{0}, 1}));
  EXPECT_EQ(lease.attempt(), 2U);
}

TEST_F(WorkerTest, ThatSeemsSilentMayWaitToBeHeard) {
  add_campaign(one, 1);
  add_worker(first);
  (void)outbox.take_sent<proto::RunLease>(first);
  state.is_behind = true;
  now += 599s;
  on_tick(state, now, outbox);
  outbox.expect_nothing_more();
  now += 1s;
  on_tick(state, now, outbox);
  EXPECT_FALSE(state.workers.contains(first)) << "others that never stop talking change nothing";
  outbox.forget();
  add_worker(second);
  now += 60s;
  on_tick(state, now, outbox);
  EXPECT_TRUE(state.workers.contains(second));
  state.is_behind = false;
  on_tick(state, now, outbox);
  EXPECT_FALSE(state.workers.contains(second)) << "all is heard";
  outbox.forget();
}

TEST_F(WorkerTest, AnyMessageIsASignOfLife) {
  add_campaign(one, 1);
  add_busy_worker(first);
  for (int i = 0; i < 3; ++i) {
    now += 50s;
    on_campaign_request(state, first, one, 0, now, outbox);
    (void)outbox.take_definition();
    on_tick(state, now, outbox);
  }
}

TEST_F(WorkerTest, ThatIsSuspectIsLentNothing) {
  add_worker(first);
  now += 15s;
  add_campaign(one, 1);
  on_tick(state, now, outbox);
  outbox.expect_nothing_more();
  heartbeat(first);
  (void)outbox.take_sent<proto::RunLease>(first);
}

TEST_F(WorkerTest, FilesKnowTheWorkersThatWereLentRunsAndHowTheyEnded) {
  const auto known = [&] {
    std::set<std::pair<CampaignId, SessionId>> all;
    for (const auto& worker : outbox.take_joined()) all.emplace(worker.campaign, worker.session);
    return all;
  };
  using Known = std::set<std::pair<CampaignId, SessionId>>;
  add_campaign(one, 1);
  add_worker(first);
  add_worker(second);
  EXPECT_EQ(known(), (Known{{one, session_of(first)}})) << "the second was lent nothing";
  on_cancel(state, one, outbox);
  on_removed(state, one, outbox);
  add_campaign(one, 2);
  EXPECT_EQ(known(), (Known{{one, session_of(first)}, {one, session_of(second)}}))
      << "another file of the campaign";
  on_bye(state, first, LossReason::walltime, now, outbox);
  add_worker(third);
  on_end(state, outbox);
  std::map<SessionId, LossReason> ended;
  for (const auto& worker : outbox.take_ended()) ended.emplace(worker.session, worker.reason);
  EXPECT_EQ(ended, (std::map<SessionId, LossReason>{{session_of(first), LossReason::walltime},
                                                    {session_of(second), LossReason::drained},
                                                    {session_of(third), LossReason::drained}}));
  outbox.forget();
}

TEST_F(WorkerTest, ThatIsAwaitedAndDoesNotComeHasEnded) {
  begin({session_of(first), session_of(second)});
  add_campaign(one, 1);
  add_busy_worker(first);
  on_tick(state, now, outbox);
  EXPECT_EQ(outbox.take_ended().size(), 0U) << "the second may still come";
  now += config.reattach_wait;
  on_tick(state, now, outbox);
  const auto ended = outbox.take_ended();
  ASSERT_EQ(ended.size(), 1U);
  EXPECT_EQ(ended[0].session, session_of(second));
  EXPECT_EQ(ended[0].reason, LossReason::silent);
  outbox.forget();
}

TEST_F(WorkerTest, DrainsUntilWhatItHoldsIsStored) {
  add_campaign(one, 5);
  add_busy_worker(first);
  on_drain(state, outbox);
  (void)outbox.take_sent<proto::Drain>(first);
  heartbeat(first, {held(one, {{0}, 1})});
  (void)outbox.take_sent<proto::Drain>(first);  // The first may have been lost.
  EXPECT_FALSE(is_quiet(state));
  deliver(first, one, {0});
  EXPECT_FALSE(is_quiet(state));
  commit(one);
  (void)outbox.take_sent<proto::ResultAck>(first);
  EXPECT_TRUE(is_quiet(state));
  EXPECT_FALSE(is_finished(campaign(one)));
}

TEST_F(WorkerTest, MayRegisterToDeliverWhileTheServiceDrains) {
  add_campaign(one, 5);
  on_drain(state, outbox);
  say_hello(first, hello());
  (void)outbox.take_sent<proto::Welcome>(first);
  (void)outbox.take_sent<proto::Drain>(first);
  (void)outbox.take_events();
  deliver(first, one, {3});
  EXPECT_EQ(outbox.take_stored(), Runs{{3}});
}

TEST_F(WorkerTest, IsToldToStopAgainAndAgain) {
  add_campaign(one, 5);
  add_busy_worker(first);
  on_stop(state, outbox);
  (void)outbox.take_sent<proto::Stop>(first);
  heartbeat(first);
  (void)outbox.take_sent<proto::Stop>(first);
  say_hello(second, hello());
  (void)outbox.take_sent<proto::Stop>(second);
}

// Results and runs of campaigns, or of runs, that are not served now: workers keep the results.

using coordinator::Phase;
using Ranges = std::vector<RunRange>;

class NotServedTest : public DispatchFixture {
 protected:
  /// The acknowledgement is taken; what else follows is not.
  void heartbeat_with_set_aside(WorkerId id, const std::vector<proto::HeldRuns>& set_aside,
                                const std::vector<proto::HeldRuns>& held_runs = {}) {
    proto::Heartbeat heartbeat = make_heartbeat(4096, held_runs);
    heartbeat.mutable_set_aside()->Assign(set_aside.begin(), set_aside.end());
    on_heartbeat(state, id, heartbeat, ++sequence, now, outbox);
    outbox.drop_sent<proto::HeartbeatAck>(id);
  }
};

// An older copy of the file was restored, from before an extension: no fault of the worker.
TEST_F(NotServedTest, ResultsBeyondTheCampaignAreKeptAndTheOthersTaken) {
  add_campaign(one, 10);
  add_busy_worker(first);
  deliver(first, one, {8, 10, 9, 12, 11, 20});
  const auto not_served = outbox.take_sent<proto::NotServed>(first);
  EXPECT_EQ(not_served.campaign(), one.value);
  EXPECT_EQ(wire::ranges_of(not_served.ranges()), (Ranges{{{10}, 3}, {{20}, 1}}));
  EXPECT_EQ(outbox.take_stored(), (Runs{{8}, {9}}));
  EXPECT_EQ(state.workers.at(first).num_results, 2U);
  outbox.forget();
}

TEST_F(NotServedTest, RunsBeyondTheCampaignAreNotLentToTheirHolder) {
  add_campaign(one, 3);
  add_busy_worker(first);
  heartbeat(first, {held(one, {{0}, 5}), held(one, {{3}, 1}, 2)});
  const auto not_served = outbox.take_sent<proto::NotServed>(first);
  EXPECT_EQ(wire::ranges_of(not_served.ranges()), (Ranges{{{3}, 2}}));
  EXPECT_EQ(runs_held_text(state, first), "0..2");
  outbox.forget();
}

// It forgets what it holds of the campaign's runs, but not what an extension may ask for.
TEST_F(NotServedTest, RunsBeyondAFinishedCampaignAreKept) {
  add_campaign(one, 1);
  add_worker(first);
  complete(first, one, {0});
  ASSERT_EQ(campaign(one).phase, Phase::finished);
  heartbeat(first, {held(one, {{0}, 2})});
  EXPECT_EQ(wire::ranges_of(outbox.take_sent<proto::NotServed>(first).ranges()),
            (Ranges{{{1}, 1}}));
  EXPECT_EQ(outbox.take_sent<proto::Forget>(first).num_runs(), 1U);
}

TEST_F(NotServedTest, WhatIsSetAsideIsLentToItsHolderOnceTheCampaignIsServed) {
  add_worker(first);
  add_busy_worker(second);
  heartbeat_with_set_aside(first, {held(one, {{0}, 2}), held(one, {{5}, 1}, 7)});
  EXPECT_EQ(outbox.num_sent(), 0U) << "the worker knows";
  add_campaign(one, 6);
  EXPECT_EQ(runs_held_text(state, first), "0..1,5");
  EXPECT_EQ(state.leases.at(campaign(one).lent.find({5}).value()).attempt, Attempt{7});
  outbox.forget();
  deliver(first, one, {0, 1});
  EXPECT_EQ(outbox.take_stored(), (Runs{{0}, {1}}));
  outbox.forget();
}

TEST_F(NotServedTest, WhatIsSetAsideIsLentToItsHolderOnceTheCampaignIsExtended) {
  add_campaign(one, 1);
  add_worker(first);
  complete(first, one, {0});
  add_worker(second);
  heartbeat_with_set_aside(first, {held(one, {{1}, 1}, 3)});
  outbox.forget();
  on_extended(state, one, stored_campaign(3).definition, now, outbox);
  EXPECT_TRUE(state.workers.at(first).leases.contains(campaign(one).lent.find({1}).value()));
  outbox.forget();
}

TEST_F(NotServedTest, WhatIsSetAsideIsLentToItsHolderByTheNextHeartbeat) {
  add_campaign(one, 3);
  say_hello(first, hello());
  outbox.forget();
  heartbeat_with_set_aside(first, {held(one, {{1}, 1})});
  EXPECT_TRUE(campaign(one).lent.find({1}).has_value());
  outbox.forget();
  now += 13s;  // It is held: it has not got lost on its way.
  heartbeat_with_set_aside(first, {held(one, {{1}, 1})}, {held(one, {{0}, 1})});
  EXPECT_TRUE(campaign(one).lent.find({1}).has_value());
  outbox.forget();
}

TEST_F(NotServedTest, WhatIsSetAsideIsForgottenOnceTheCampaignHasEnded) {
  add_worker(first);
  on_ended(state, one, 5);
  heartbeat_with_set_aside(first, {held(one, {{0}, 2})});
  EXPECT_EQ(outbox.take_sent<proto::Forget>(first).num_runs(), 5U);
  add_campaign(two, 5);
  on_cancel(state, two, outbox);
  outbox.forget();
  heartbeat_with_set_aside(first, {held(two, {{0}, 2})});
  EXPECT_EQ(outbox.take_sent<proto::Forget>(first).campaign(), two.value);
}

// Otherwise one campaign whose file cannot be opened would keep another from its end.
TEST_F(NotServedTest, AWorkerWithResultsThatAreSetAsideTriesSuspects) {
  add_campaign(one, 1);
  add_worker(first);
  crash(first);
  outbox.forget();
  say_hello(second, hello());
  outbox.forget();
  heartbeat_with_set_aside(second, {held(two, {{0}, 3})});
  EXPECT_TRUE(outbox.take_sent<proto::RunLease>(second).is_alone());
  outbox.forget();
}

// What waits or is computed may crash the worker while it tries the suspect.
TEST_F(NotServedTest, AWorkerWithOtherRunsOfACampaignThatIsNotServedTriesNoSuspects) {
  add_campaign(one, 1);
  add_worker(first);
  crash(first);
  outbox.forget();
  say_hello(second, hello());
  outbox.forget();
  heartbeat(second, {held(two, {{0}, 3})});
  EXPECT_EQ(outbox.take_sent<proto::NotServed>(second).campaign(), two.value);
}

TEST_F(NotServedTest, ALateResultOfARunThatWasGivenUpReopensAFinishedCampaign) {
  StoredCampaign stored = stored_campaign(2);
  stored.finished = {{{1}, 1}};
  stored.given_up = {{{0}, 1}};
  stored.control.audit_fraction = 1.0;
  stored.compared = {{{1}, 1}};
  stored.control.phase = Phase::finished;
  on_campaign(state, one, stored, now, outbox);
  add_busy_worker(first);
  ASSERT_EQ(campaign(one).phase, Phase::finished);
  deliver(first, one, {0});
  EXPECT_EQ(campaign(one).phase, Phase::active);
  check_invariants(state);
  commit(one);
  outbox.forget();
  deliver(first, one, {0}, 2);  // Its audit.
  on_compared(state, one, {0}, first, true, now, outbox);
  EXPECT_EQ(campaign(one).phase, Phase::finished);
  outbox.forget();
}

}  // namespace
}  // namespace proofmass::test
