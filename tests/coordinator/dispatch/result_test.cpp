// Results: stored once, acknowledged when durable.

#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

class ResultTest : public DispatchFixture {
 protected:
  void SetUp() override {
    add_campaign(one, 10);
    add_busy_worker(first);
  }
};

// Once it was stored, the file would be called damaged for ever.
TEST_F(ResultTest, ThatNoSimulationYieldsIsRefused) {
  wire::ComputedRun impossible = computed(0);
  impossible.result.num_draws = 4294967295;
  on_results(state, first, one, {1}, {computed(1), impossible}, now, outbox);
  const auto reject = outbox.take_sent<proto::Reject>(first);
  EXPECT_EQ(reject.reason(), proto::REJECT_REASON_MALFORMED);
  EXPECT_EQ(reject.text(), "run 0: num_draws = 4294967295 (must be 1 to 1000 if completed)");
  EXPECT_TRUE(outbox.stored().empty());
  EXPECT_FALSE(state.workers.contains(first));
  EXPECT_EQ(outbox.take_losses().at(0).reason, LossReason::protocol);
  (void)outbox.take_events();
}

TEST_F(ResultTest, RepeatedBeforeTheCommitIsOneThatWaits) {
  deliver(first, one, {0});
  (void)outbox.take_sent<proto::RunLease>(first);
  deliver(first, one, {0});
  commit(one);
  EXPECT_EQ(wire::runs_of(outbox.take_sent<proto::ResultAck>(first)), Runs{{0}});
  EXPECT_EQ(campaign(one).num_duplicates, 0U);
}

TEST_F(ResultTest, RepeatedAfterTheCommitIsAcknowledgedAtOnceAndCompared) {
  complete(first, one, {0});
  deliver(first, one, {0});
  EXPECT_EQ(wire::runs_of(outbox.take_sent<proto::ResultAck>(first)), Runs{{0}});
  EXPECT_EQ(outbox.take_compared(), Runs{{0}});
  EXPECT_EQ(campaign(one).num_duplicates, 1U);
  EXPECT_EQ(campaign(one).num_comparing, 1U);
  on_compared(state, one, {0}, first, true, now, outbox);
  EXPECT_EQ(campaign(one).num_audited, 1U);
}

// Of one that sends the same again and again; it would fill the memory if the disk is slow.
TEST_F(ResultTest, IsNotComparedWhileTooManyWaitForThat) {
  complete(first, one, {0});
  state.config.uncommitted_max = 2;
  for (int i = 0; i < 3; ++i) deliver(first, one, {0});
  EXPECT_EQ(outbox.take_compared(), (Runs{{0}, {0}}));
  EXPECT_EQ(campaign(one).num_comparing, 2U);
  EXPECT_EQ(campaign(one).num_duplicates, 3U);
  for (int i = 0; i < 3; ++i) (void)outbox.take_sent<proto::ResultAck>(first);
  on_compared(state, one, {0}, first, true, now, outbox);
  on_compared(state, one, {0}, first, true, now, outbox);
}

TEST_F(ResultTest, OfAnotherWorkerWaitsForTheSameCommitAndIsCompared) {
  add_busy_worker(second);
  deliver(first, one, {0});
  outbox.forget();
  deliver(second, one, {0});
  EXPECT_EQ(outbox.take_compared(), Runs{{0}});
  outbox.forget();
  on_committed(state, one, Runs{{0}}, now, outbox);
  EXPECT_EQ(wire::runs_of(outbox.take_sent<proto::ResultAck>(first)), Runs{{0}});
  EXPECT_EQ(wire::runs_of(outbox.take_sent<proto::ResultAck>(second)), Runs{{0}});
}

TEST_F(ResultTest, OfARunThatIsLentToAnotherIsTakenAndTheOtherOneAskedBack) {
  add_busy_worker(second);
  deliver(first, one, {1});  // Lent to the second.
  EXPECT_EQ(outbox.take_stored(), Runs{{1}});
  EXPECT_EQ(taken_back(second), (std::vector<RunRange>{{{1}, 1}}));
  EXPECT_EQ(state.workers.at(second).num_lent, 0U);
  outbox.forget();
}

// At the first heartbeat after a restart: runs 0 and 1 may be finished, run 2 is not.
TEST_F(ResultTest, SaysNothingOfTheRateIfItMayHaveBeenThereBefore) {
  add_campaign(two, 10);
  add_worker(second);
  outbox.forget();
  heartbeat(second, {held(two, {{0}, 3})}, {make_computed_batch(two, {{{2}, 1}}, 7)}, 0);
  complete(second, two, {0, 1, 2});
  EXPECT_EQ(campaign(two).num_committed_here, 3U);
  EXPECT_EQ(campaign(two).num_kept, 2U);
  complete(first, one, {0});  // Lent to it.
  EXPECT_EQ(campaign(one).num_kept, 0U);
}

TEST_F(ResultTest, OfACampaignThatIsNotServedIsKept) {
  deliver(first, two, {0});
  const auto not_served = outbox.take_sent<proto::NotServed>(first);
  EXPECT_EQ(not_served.campaign(), two.value);
  EXPECT_TRUE(wire::ranges_of(not_served.ranges()).empty());
}

TEST_F(ResultTest, OfACampaignThatHasEndedIsForgottenUntilItIsServedAgain) {
  on_ended(state, two, 1);
  deliver(first, two, {0});
  EXPECT_EQ(outbox.take_sent<proto::Forget>(first).campaign(), two.value);
  add_campaign(two, 1);
  EXPECT_TRUE(state.ended.empty());
  deliver(first, two, {0});
  EXPECT_EQ(outbox.take_stored(), Runs{{0}});
  outbox.forget();
}

// Everything behind the dispatch takes a value for each quantity of the campaign for granted.
TEST_F(ResultTest, OfOtherQuantitiesThanTheCampaignsIsRefused) {
  wire::ComputedRun other = computed(0);
  other.result.estimate.push_back(0.0);
  on_results(state, first, one, {1}, {other}, now, outbox);
  const auto reject = outbox.take_sent<proto::Reject>(first);
  EXPECT_EQ(reject.reason(), proto::REJECT_REASON_MALFORMED);
  EXPECT_EQ(reject.text(), "run 0: estimate = 11 entries (must be 10 if completed)");
  EXPECT_TRUE(outbox.stored().empty());
  outbox.forget();
}

TEST_F(ResultTest, LastOneEndsTheCampaignAndWorkersForgetIt) {
  complete(first, one, {0, 1, 2, 3, 4, 5, 6, 7, 8});
  deliver(first, one, {9});
  EXPECT_FALSE(is_finished(campaign(one)));
  commit(one);
  EXPECT_TRUE(is_finished(campaign(one)));
  EXPECT_EQ(campaign(one).phase, coordinator::Phase::finished);
  (void)outbox.take_sent<proto::ResultAck>(first);
  EXPECT_EQ(outbox.take_sent<proto::Forget>(first).campaign(), one.value);
  EXPECT_EQ(outbox.take_events(),
            Strings{"campaign_finished runs=10 given_up=0 duplicates=0 compared=0"});
}

}  // namespace
}  // namespace proofmass::test
