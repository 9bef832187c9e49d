#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

// Several campaigns: what is lent first, what is paused, cancelled and extended.

using coordinator::Phase;
using Ranges = std::vector<RunRange>;

class CampaignTest : public DispatchFixture {};

TEST_F(CampaignTest, TheOlderOfEqualPriorityIsLentFirst) {
  add_campaign(two, 1);
  add_campaign(one, 1);
  add_worker(first);
  EXPECT_EQ(outbox.take_sent<proto::RunLease>(first).campaign(), two.value);
}

TEST_F(CampaignTest, RunsThatAreComputedElsewhereAreNotLent) {
  StoredCampaign stored = stored_campaign(10);
  stored.finished = {{{1}, 2}};
  stored.elsewhere = {{{0}, 4}, {{6}, 4}};
  stored.blamed = {{.run = {7}, .num_crashes = 1, .attempt = {1}}};
  on_campaign(state, one, stored, now, outbox);
  add_worker(first, 4);
  EXPECT_EQ(taken_lease(first), (RunRange{{4}, 2}));
  deliver(first, one, {4, 5});
  commit(one);
  EXPECT_EQ(campaign(one).phase, Phase::finished);
  EXPECT_EQ(outbox.take_events(),
            Strings{"part_finished runs=4 given_up=0 duplicates=0 compared=0"});
  outbox.forget();
}

// A worker that comes from another coordinator may hold or have computed them.
TEST_F(CampaignTest, AResultOfARunThatIsComputedElsewhereIsTaken) {
  StoredCampaign stored = stored_campaign(4);
  stored.elsewhere = {{{1}, 3}};
  on_campaign(state, one, stored, now, outbox);
  add_worker(first);
  complete(first, one, {0});
  ASSERT_EQ(campaign(one).phase, Phase::finished);
  heartbeat(first, {held(one, {{1}, 2})});
  outbox.forget();
  deliver(first, one, {2});
  EXPECT_FALSE(is_finished(campaign(one)));
  const Runs stored_runs = outbox.take_stored();
  EXPECT_EQ(stored_runs, Runs{{2}});
  on_committed(state, one, stored_runs, now, outbox);
  EXPECT_TRUE(is_finished(campaign(one)));
  EXPECT_EQ(campaign(one).committed.ranges(), (Ranges{{{0}, 1}, {{2}, 1}}));
  outbox.forget();
}

// They may crash again, so they are lent last and alone.
TEST_F(CampaignTest, ThatIsRetriedLendsTheRunsThatWereGivenUpAsSuspects) {
  StoredCampaign stored = stored_campaign(3);
  stored.finished = {{{0}, 1}};
  stored.given_up = {{{1}, 2}};
  on_campaign(state, one, stored, now, outbox);
  ASSERT_EQ(campaign(one).phase, Phase::finished);
  (void)outbox.take_events();
  on_retry(state, one, now, outbox);
  EXPECT_EQ(outbox.take_events(), Strings{"given_up_runs_retried runs=2"});
  EXPECT_EQ(campaign(one).phase, Phase::active);
  EXPECT_TRUE(campaign(one).given_up.empty());
  add_worker(first, 4);
  const auto lease = outbox.take_sent<proto::RunLease>(first);
  EXPECT_EQ(wire::runs_of(lease), (RunRange{{1}, 1}));
  EXPECT_TRUE(lease.is_alone());
  outbox.forget();
}

TEST_F(CampaignTest, ThatIsPausedIsNotLentAndAskedBack) {
  add_campaign(one, 10);
  add_busy_worker(first, 2);
  on_pause(state, one, outbox);
  EXPECT_EQ(taken_back(first), (Ranges{{{0}, 2}}));
  on_pause(state, one, outbox);
  outbox.expect_nothing_more();

  // The one that is computed is not asked back again.
  heartbeat(first, {held(one, {{0}, 2})}, {make_computed_batch(one, {{{0}, 1}})});
  EXPECT_EQ(taken_back(first), (Ranges{{{1}, 1}}));
  give_back(first, held(one, {{1}, 1}));
  EXPECT_EQ(outbox.num_sent(), 0U);
  deliver(first, one, {0});
  EXPECT_EQ(outbox.take_stored(), Runs{{0}});
  EXPECT_EQ(outbox.num_sent(), 0U);

  outbox.forget();
  on_resume(state, one, now, outbox);
  EXPECT_EQ(taken_lease(first), (RunRange{{1}, 1}));
  outbox.forget();
}

TEST_F(CampaignTest, ThatIsPausedIsAskedBackFromAWorkerThatOutlivedTheCoordinator) {
  add_campaign(one, 3);
  on_pause(state, one, outbox);
  add_worker(first);
  heartbeat(first, {held(one, {{0}, 2})});
  EXPECT_EQ(taken_back(first), (Ranges{{{0}, 2}}));
  EXPECT_EQ(state.workers.at(first).num_lent, 2U);
}

TEST_F(CampaignTest, ThatIsResumedIsNotAskedBackAnyMore) {
  add_campaign(one, 2);
  add_worker(first, 2);
  on_pause(state, one, outbox);
  on_resume(state, one, now, outbox);
  outbox.forget();
  heartbeat(first, {held(one, {{0}, 2})});
}

TEST_F(CampaignTest, ThatIsCancelledIsForgotten) {
  add_campaign(one, 10);
  add_busy_worker(first, 2);
  on_cancel(state, one, outbox);
  EXPECT_EQ(outbox.take_sent<proto::Forget>(first).campaign(), one.value);
  EXPECT_TRUE(state.leases.empty());
  outbox.forget();
  deliver(first, one, {0});
  EXPECT_EQ(outbox.take_sent<proto::Forget>(first).campaign(), one.value);
  on_campaign_request(state, first, one, 0, now, outbox);
  EXPECT_EQ(outbox.take_sent<proto::Forget>(first).campaign(), one.value);
  on_cancel(state, one, outbox);
}

TEST_F(CampaignTest, ThatIsCancelledKeepsWhatWasDelivered) {
  add_campaign(one, 10);
  add_busy_worker(first);
  deliver(first, one, {0});
  on_cancel(state, one, outbox);
  EXPECT_FALSE(is_quiet(state));
  on_committed(state, one, outbox.take_stored(), now, outbox);
  EXPECT_TRUE(campaign(one).committed.contains({0}));
  EXPECT_TRUE(is_quiet(state));
  EXPECT_EQ(campaign(one).phase, Phase::cancelled);
  outbox.forget();
}

TEST_F(CampaignTest, ThatWasCancelledGoesOnUnderAHigherAttempt) {
  add_campaign(one, 1);
  add_worker(first);
  on_cancel(state, one, outbox);
  outbox.forget();
  on_resume(state, one, now, outbox);
  EXPECT_EQ(outbox.take_sent<proto::RunLease>(first).attempt(), 2U);
}

TEST_F(CampaignTest, ThatIsExtendedGoesOn) {
  add_campaign(one, 1);
  add_worker(first);
  complete(first, one, {0});
  ASSERT_EQ(campaign(one).phase, Phase::finished);
  on_extended(state, one, stored_campaign(3).definition, now, outbox);
  EXPECT_EQ(campaign(one).phase, Phase::active);
  EXPECT_EQ(taken_lease(first), (RunRange{{1}, 1}));
}

TEST_F(CampaignTest, ThatIsRemovedIsForgottenIfItHasEnded) {
  add_campaign(one, 1);
  add_campaign(two, 1);
  add_worker(first);
  complete(first, one, {0});
  on_cancel(state, two, outbox);
  outbox.forget();
  for (const CampaignId id : {one, two}) {
    on_removed(state, id, outbox);
    EXPECT_EQ(outbox.take_sent<proto::Forget>(first).campaign(), id.value);
    deliver(first, id, {0});
    EXPECT_EQ(outbox.take_sent<proto::Forget>(first).campaign(), id.value);
  }
}

TEST_F(CampaignTest, ThatIsRemovedBeforeItsEndLeavesOnlyResultsOfWorkers) {
  add_campaign(one, 10);
  add_busy_worker(first);
  on_removed(state, one, outbox);
  EXPECT_EQ(outbox.take_sent<proto::NotServed>(first).campaign(), one.value);
  EXPECT_TRUE(state.campaigns.empty());
  EXPECT_TRUE(state.leases.empty());
  outbox.forget();
  on_compared(state, one, {0}, first, true, now, outbox);  // It was under way.
}

// Workers that are registered and say what cannot be. Nothing that they say may end the service:
// each test ends with a check of the state.

constexpr std::uint32_t attempt_max = std::numeric_limits<std::uint32_t>::max();

class HostileTest : public DispatchFixture {
 protected:
  void TearDown() override {
    outbox.forget();
    DispatchFixture::TearDown();
  }
};

TEST(BoundedDuration, IsOfTheSecondsUpToAMillion) {
  EXPECT_EQ(coordinator::bounded_duration(0.25), 250ms);
  EXPECT_EQ(coordinator::bounded_duration(999'999.0), 999'999s);
  EXPECT_EQ(coordinator::bounded_duration(1e300), 1'000'000s);
  EXPECT_EQ(coordinator::bounded_duration(std::numeric_limits<double>::infinity()), 1'000'000s);
}

// A copy of a run goes out under the attempt after: it must not become 0, which no worker takes.
TEST_F(HostileTest, TheLargestAttemptFollowsItself) {
  add_campaign(one, 2);
  say_hello(first, hello());
  heartbeat(first, {held(one, {{0}, 2}, attempt_max)});
  EXPECT_EQ(runs_held_text(state, first), "0..1");
  outbox.forget();
  add_worker(second, 2);
  now += 16s;
  heartbeat(second);
  on_tick(state, now, outbox);  // The first is silent: its runs are copied.
  EXPECT_EQ(outbox.take_sent<proto::RunLease>(second).attempt(), attempt_max);
  outbox.forget();
  crash(first);
  deliver(second, one, {0, 1}, attempt_max);
  EXPECT_EQ(outbox.take_stored().size(), 2U);
}

// Others computed the campaign, and it was idle, for as long as one worker liked.
TEST_F(HostileTest, RunsAreHeldAndNeverFinished) {
  config.lease_duration_max = 2min;
  begin();
  add_campaign(one, 8);
  add_worker(first, 8, "liar");
  add_worker(second, 8, "honest");
  ASSERT_EQ(runs_held_text(state, second), "none");
  outbox.forget();
  const TimePoint lent_at = now;
  std::uint32_t num_steps = 0;
  while (runs_held_text(state, second) == "none" && now - lent_at < 10min) {
    now += 5s;
    heartbeat(first, {held(one, {{0}, 8})}, {make_computed_batch(one, {{{0}, 8}}, ++num_steps)});
    heartbeat(second);
    on_tick(state, now, outbox);
  }
  EXPECT_LT(now - lent_at, 3min);
  EXPECT_EQ(runs_held_text(state, second), "0..7");
  EXPECT_EQ(outbox.take_events().at(0), "nothing_finished for_s=120 leases=1 idle_workers=1");
}

TEST_F(HostileTest, AnAuditIsHeldForEver) {
  config.lease_duration_max = 2min;
  begin();
  add_campaign(one, 1, 0, 1.0);
  add_worker(first, 1, "honest");
  add_worker(second, 1, "liar");
  complete(first, one, {0});
  ASSERT_EQ(runs_held_text(state, second), "0");
  const TimePoint lent_at = now;
  while (runs_held_text(state, first) == "none" && now - lent_at < 10h) {
    now += 5s;
    heartbeat(first);
    heartbeat(second, {held(one, {{0}, 1}, 2)}, {make_computed_batch(one, {{{0}, 1}}, 1)});
    on_tick(state, now, outbox);
  }
  EXPECT_EQ(runs_held_text(state, first), "0") << "better than nothing";
}

TEST_F(HostileTest, ATruthIsMadeUpOfARunThatWasNotLent) {
  add_campaign(one, 10);
  add_busy_worker(first);
  wire::ComputedRun made_up = computed(7);
  made_up.result.truth[3] += 1e-9;
  on_results(state, first, one, {1}, {made_up}, now, outbox);
  EXPECT_EQ(outbox.take_sent<proto::Reject>(first).reason(), proto::REJECT_REASON_MALFORMED);
  EXPECT_EQ(outbox.take_events().at(0),
            "results_refused worker=1 name=w reason=\"run 7: truth (must be what the run draws)\"");
  EXPECT_FALSE(state.workers.contains(first));
  EXPECT_TRUE(outbox.take_stored().empty());
  deliver(first, one, {7});
  add_worker(first);
  deliver(first, one, {7});
  EXPECT_EQ(outbox.take_stored(), Runs{{7}}) << "as the run draws it";
}

}  // namespace
}  // namespace proofmass::test
