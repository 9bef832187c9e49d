// Several campaigns: what is lent first, what is paused, cancelled and extended.

#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

using coordinator::Phase;
using Ranges = std::vector<RunRange>;

class CampaignTest : public DispatchFixture {};

TEST_F(CampaignTest, OfHigherPriorityIsLentFirst) {
  add_campaign(one, 1);
  add_campaign(two, 1, 5);
  add_worker(first);
  EXPECT_EQ(outbox.take_sent<proto::RunLease>(first).campaign(), two.value);
  deliver(first, two, {0});
  EXPECT_EQ(outbox.take_sent<proto::RunLease>(first).campaign(), one.value);
  outbox.forget();
}

TEST_F(CampaignTest, TheOlderOfEqualPriorityIsLentFirst) {
  add_campaign(two, 1);
  add_campaign(one, 1);
  add_worker(first);
  EXPECT_EQ(outbox.take_sent<proto::RunLease>(first).campaign(), two.value);
}

TEST_F(CampaignTest, WorkersThatWaitAreLentItsRunsAtOnce) {
  add_worker(first);
  add_campaign(one, 1);
  (void)outbox.take_sent<proto::RunLease>(first);
}

TEST_F(CampaignTest, OnlyWhatIsNotFinishedIsLent) {
  StoredCampaign stored = stored_campaign(10);
  stored.finished = {{{0}, 4}, {{5}, 4}};
  stored.given_up = {{{9}, 1}};
  on_campaign(state, one, stored, now, outbox);
  add_worker(first, 4);
  EXPECT_EQ(wire::runs_of(outbox.take_sent<proto::RunLease>(first)), (RunRange{{4}, 1}));
}

TEST_F(CampaignTest, RunsThatAreComputedElsewhereAreNotLent) {
  StoredCampaign stored = stored_campaign(10);
  stored.finished = {{{1}, 2}};
  stored.elsewhere = {{{0}, 4}, {{6}, 4}};
  stored.blamed = {{.run = {7}, .num_crashes = 1, .attempt = {1}}};
  on_campaign(state, one, stored, now, outbox);
  add_worker(first, 4);
  EXPECT_EQ(wire::runs_of(outbox.take_sent<proto::RunLease>(first)), (RunRange{{4}, 2}));
  deliver(first, one, {4, 5});
  commit(one);
  EXPECT_EQ(campaign(one).phase, Phase::finished);
  EXPECT_EQ(outbox.take_events(),
            Strings{"part_finished runs=4 given_up=0 duplicates=0 compared=0 mismatches=0"});
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

TEST_F(CampaignTest, ThatIsDoneIsFinishedAtOnce) {
  StoredCampaign stored = stored_campaign(2);
  stored.finished = {{{0}, 1}};
  stored.given_up = {{{1}, 1}};
  on_campaign(state, one, stored, now, outbox);
  EXPECT_EQ(campaign(one).phase, Phase::finished);
  (void)outbox.take_events();
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
  add_worker(first, 2);
  outbox.forget();
  on_pause(state, one, outbox);
  EXPECT_EQ(wire::ranges_of(outbox.take_sent<proto::Retract>(first).ranges()), (Ranges{{{0}, 2}}));
  on_pause(state, one, outbox);
  outbox.expect_nothing_more();

  // The one that is computed is not asked back again.
  heartbeat(first, {held(one, {{0}, 2})}, {make_computed_batch(one, {{{0}, 1}})});
  EXPECT_EQ(wire::ranges_of(outbox.take_sent<proto::Retract>(first).ranges()), (Ranges{{{1}, 1}}));
  on_give_back(state, first, make_give_back(LossReason::retracted, {held(one, {{1}, 1})}), now,
               outbox);
  EXPECT_EQ(outbox.num_sent(), 0U);
  deliver(first, one, {0});
  EXPECT_EQ(outbox.take_stored(), Runs{{0}});
  EXPECT_EQ(outbox.num_sent(), 0U);

  outbox.forget();
  on_resume(state, one, now, outbox);
  EXPECT_EQ(wire::runs_of(outbox.take_sent<proto::RunLease>(first)), (RunRange{{1}, 1}));
  outbox.forget();
}

TEST_F(CampaignTest, ThatIsPausedIsAskedBackFromAWorkerThatOutlivedTheCoordinator) {
  add_campaign(one, 3);
  on_pause(state, one, outbox);
  add_worker(first);
  heartbeat(first, {held(one, {{0}, 2})});
  EXPECT_EQ(wire::ranges_of(outbox.take_sent<proto::Retract>(first).ranges()), (Ranges{{{0}, 2}}));
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

TEST_F(CampaignTest, ThatIsPausedLetsOthersGoOn) {
  add_campaign(one, 10, 5);
  add_campaign(two, 10);
  add_worker(first);
  on_pause(state, one, outbox);
  outbox.forget();
  on_give_back(state, first, make_give_back(LossReason::retracted, {held(one, {{0}, 1})}), now,
               outbox);
  EXPECT_EQ(outbox.take_sent<proto::RunLease>(first).campaign(), two.value);
  outbox.forget();
}

TEST_F(CampaignTest, ThatIsPausedIsFinishedByItsLastResults) {
  add_campaign(one, 1);
  add_worker(first);
  on_pause(state, one, outbox);
  outbox.forget();
  deliver(first, one, {0});
  commit(one);
  EXPECT_EQ(campaign(one).phase, Phase::finished);
  outbox.forget();
}

TEST_F(CampaignTest, ThatIsCancelledIsForgotten) {
  add_campaign(one, 10);
  add_worker(first, 2);
  outbox.forget();
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
  add_worker(first);
  outbox.forget();
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
  EXPECT_EQ(wire::runs_of(outbox.take_sent<proto::RunLease>(first)), (RunRange{{1}, 1}));
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
  add_worker(first);
  outbox.forget();
  on_removed(state, one, outbox);
  EXPECT_EQ(outbox.take_sent<proto::NotServed>(first).campaign(), one.value);
  EXPECT_TRUE(state.campaigns.empty());
  EXPECT_TRUE(state.leases.empty());
  outbox.forget();
  on_compared(state, one, {0}, first, true, now, outbox);  // It was under way.
}

TEST_F(CampaignTest, ABillionRunsCostNothing) {
  add_campaign(one, num_runs_max);
  EXPECT_EQ(campaign(one).pending.at({1}).num_ranges(), 1U);
}

}  // namespace
}  // namespace proofmass::test
