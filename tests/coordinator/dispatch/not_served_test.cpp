// Results and runs of campaigns, or of runs, that are not served now: workers keep the results.

#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

using namespace std::chrono_literals;
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
  add_worker(first);
  outbox.forget();
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
  add_worker(first);
  outbox.forget();
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
  add_worker(second);
  outbox.forget();
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
  add_worker(first);
  outbox.forget();
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
