#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

// What may be said about a host, and by whom; how many workers and hosts are kept.

using coordinator::HostId;

const std::string some_key = "key-a";
const std::string other_key = "key-b";

class HostsTest : public DispatchFixture {
 protected:
  HostsTest() {
    config.hellos_per_s_max = 1e6;
    begin();
  }

  /// Takes no runs.
  void join(WorkerId id, const std::string& key, const std::string& host = "host") {
    say_hello(id, hello(1, host), key);
    outbox.forget();
  }
  void join_and_take_runs(WorkerId id, const std::string& key, const std::string& host = "host") {
    join(id, key, host);
    heartbeat(id);
    ASSERT_GT(state.workers.at(id).num_lent, 0U);
    outbox.forget();
  }
  /// A new process says that the one before it crashed.
  void succeed(WorkerId id, WorkerId former, const std::string& key,
               const std::string& host = "host") {
    proto::Hello successor = hello(1, host);
    *successor.mutable_former() = make_former(session_of(former));
    say_hello(id, successor, key);
    outbox.forget();
  }
  [[nodiscard]] std::uint32_t num_crashes(const std::string& key,
                                          const std::string& host = "host") const {
    const auto found = state.hosts.find({.key = key, .address = host});
    return found == state.hosts.end() ? 0 : found->second.num_crashes;
  }
};

TEST_F(HostsTest, ACrashIsBelievedFromTheSameKeyOnTheSameHost) {
  add_campaign(one, 10);
  join_and_take_runs(first, some_key);
  succeed(second, first, some_key);
  EXPECT_FALSE(state.workers.contains(first));
  EXPECT_EQ(num_crashes(some_key), 1U);
  EXPECT_TRUE(campaign(one).suspects.contains({0}));
}

// Its runs are free at once, and neither they nor the host are blamed.
TEST_F(HostsTest, AKillIsNoCrash) {
  add_campaign(one, 10);
  join_and_take_runs(first, some_key);
  proto::Hello successor = hello(1, "host");
  *successor.mutable_former() = make_former(session_of(first), LossReason::preempted);
  say_hello(second, successor, some_key);
  outbox.forget();
  EXPECT_FALSE(state.workers.contains(first));
  EXPECT_EQ(num_crashes(some_key), 0U);
  EXPECT_TRUE(campaign(one).suspects.empty());
  heartbeat(second);
  EXPECT_GT(state.workers.at(second).num_lent, 0U);
  outbox.forget();
}

TEST_F(HostsTest, ACrashIsNotBelievedFromAnotherKeyOrHost) {
  add_campaign(one, 10);
  join_and_take_runs(first, some_key);
  succeed(second, first, other_key);
  succeed(third, first, some_key, "elsewhere");
  EXPECT_TRUE(state.workers.contains(first));
  EXPECT_EQ(num_crashes(some_key), 0U);
  EXPECT_TRUE(campaign(one).suspects.empty());
}

// Five messages were once enough to lock out a host with all its honest workers.
TEST_F(HostsTest, ProcessesThatHeldNothingPutNoHostUnderQuarantine) {
  add_campaign(one, 10);
  for (std::uint64_t i = 1; i <= 20; ++i) {
    join(WorkerId{10 * i}, some_key);
    succeed(WorkerId{10 * i + 1}, WorkerId{10 * i}, some_key);
  }
  EXPECT_TRUE(state.quarantined.empty());
  EXPECT_EQ(num_crashes(some_key), 0U);
}

TEST_F(HostsTest, AKeyQuarantinesAHostForItselfAlone) {
  add_campaign(one, 100);
  join_and_take_runs(first, some_key);
  for (std::uint64_t i = 10; i < 15; ++i) {
    join_and_take_runs(WorkerId{i}, other_key);
    crash(WorkerId{i});
    outbox.forget();
  }
  EXPECT_EQ(state.quarantined.size(), 1U);
  EXPECT_TRUE(state.quarantined.contains(HostId{other_key, "host"}));
  say_hello(second, hello(), other_key);
  EXPECT_EQ(outbox.take_sent<proto::Reject>(second).reason(), proto::REJECT_REASON_QUARANTINED);
  say_hello(third, hello(), some_key);
  EXPECT_EQ(outbox.take_sent<proto::Welcome>(third).worker_id(), third.value);
  outbox.forget();
}

TEST_F(HostsTest, AHostIsReleasedForAllItsKeys) {
  add_campaign(one, 100);
  for (const std::string& key : {some_key, other_key}) {
    for (std::uint64_t i = 10; i < 15; ++i) {
      join_and_take_runs(WorkerId{i}, key, "bad");
      crash(WorkerId{i});
      outbox.forget();
    }
  }
  ASSERT_EQ(state.quarantined.size(), 2U);
  EXPECT_TRUE(is_quarantined(state, "bad"));
  EXPECT_FALSE(on_release_host(state, "host", now, outbox));
  EXPECT_TRUE(on_release_host(state, "bad", now, outbox));
  EXPECT_EQ(outbox.take_events(), Strings{"host_released host=bad"});
  EXPECT_FALSE(is_quarantined(state, "bad"));
  EXPECT_EQ(num_crashes(some_key, "bad"), 0U) << "its row of crashes begins anew";
  EXPECT_FALSE(on_release_host(state, "bad", now, outbox));
  join_and_take_runs(first, some_key, "bad");
}

// A cluster that restarts leaves thousands of registrations of dead processes behind.
TEST_F(HostsTest, ARegistrationThatIsSilentMakesRoomForAnother) {
  config.num_workers_max = 2;
  begin();
  add_campaign(one, 10);
  join_and_take_runs(first, some_key);
  now += 1s;
  join(second, some_key);
  now += 14s;  // The first has been silent for 15 s, the second for 14 s.
  say_hello(third, hello(), some_key);
  EXPECT_EQ(outbox.take_losses().at(0).reason, LossReason::silent);
  EXPECT_EQ(outbox.take_sent<proto::Welcome>(third).worker_id(), third.value);
  EXPECT_FALSE(state.workers.contains(first));
  EXPECT_TRUE(state.workers.contains(second));
  outbox.forget();
  say_hello(first, hello(), some_key);
  EXPECT_EQ(outbox.take_sent<proto::Reject>(first).reason(), proto::REJECT_REASON_FULL);
  outbox.forget();
}

TEST_F(HostsTest, OfAKeyAreForgottenWhenThereAreTooMany) {
  config.hosts_per_key_max = 3;
  begin();
  add_campaign(one, 1000);
  join_and_take_runs(first, some_key, "honest");
  for (std::uint64_t i = 10; i < 15; ++i) {
    join_and_take_runs(WorkerId{i}, some_key, "quarantined");
    crash(WorkerId{i});
    outbox.forget();
  }
  ASSERT_EQ(state.quarantined.size(), 1U);
  for (std::uint64_t i = 100; i < 200; ++i) {
    now += 1ms;
    join_and_take_runs(WorkerId{i}, other_key, "made-up-" + std::to_string(i));
    crash(WorkerId{i});
    outbox.forget();
  }
  EXPECT_EQ(state.quarantined.size(), 1U) << "what another key does changes nothing";
  EXPECT_EQ(state.hosts.size(), 2U + 3U);
  EXPECT_EQ(num_crashes(other_key, "made-up-199"), 1U) << "the oldest are forgotten";
  for (std::uint64_t i = 200; i < 203; ++i) {
    now += 1ms;
    join_and_take_runs(WorkerId{i}, some_key, "made-up-" + std::to_string(i));
    crash(WorkerId{i});
    outbox.forget();
  }
  EXPECT_TRUE(state.quarantined.empty()) << "it was the oldest of this key";
  EXPECT_TRUE(state.hosts.contains({some_key, "honest"})) << "it has a worker";
}

// Heartbeats make both sides agree about what a worker holds.

using Ranges = std::vector<RunRange>;

class HeartbeatTest : public DispatchFixture {
 protected:
  /// The first worker has been lent run 0 of three.
  void lend_one() {
    add_campaign(one, 3);
    add_busy_worker(first);
  }
};

TEST_F(HeartbeatTest, ALeaseIsNotMissedInAHeartbeatThatHasWaited) {
  lend_one();
  state.is_behind = true;
  now += 12s;
  heartbeat(first);
  EXPECT_EQ(state.leases.size(), 1U);
  outbox.expect_nothing_more();
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

  give_back(first, held(one, {{0}, 1}, 2), LossReason::walltime);
  outbox.expect_nothing_more();
  give_back(first, held(one, {{0}, 1}, 1), LossReason::walltime);
  EXPECT_EQ(outbox.take_losses().at(0).attempt, Attempt{2});
  outbox.forget();
}

TEST_F(HeartbeatTest, NobodyIsLentMoreThanAWorkerCanHoldBecauseItSaysSo) {
  add_campaign(one, 1'000'000);
  add_busy_worker(first);
  heartbeat(first, {held(one, {{0}, 1'000'000})});
  EXPECT_EQ(state.workers.at(first).num_lent, 1U);
  EXPECT_EQ(taken_back(first), (Ranges{{{1}, 999'999}}));
}

TEST_F(HeartbeatTest, ARunThatIsLentToAnotherWorkerIsAskedBack) {
  lend_one();
  add_busy_worker(second);
  heartbeat(second, {held(one, {{0}, 2})});
  EXPECT_EQ(taken_back(second), (Ranges{{{0}, 1}}));
  EXPECT_TRUE(state.workers.at(second).unleased.at(one).contains({0}));
  give_back(second, held(one, {{0}, 1}));
  EXPECT_TRUE(state.workers.at(second).unleased.empty());
}

TEST_F(HeartbeatTest, AStoredRunThatStillWaitsIsAskedBack) {
  lend_one();
  complete(first, one, {0});
  heartbeat(first, {held(one, {{0}, 3})});
  EXPECT_EQ(taken_back(first), (Ranges{{{0}, 1}}));
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

// A message that was long under way must not take back what has been lent anew since.
TEST_F(HeartbeatTest, AGiveBackOfAnOlderAttemptIsIgnored) {
  lend_one();
  give_back(first, held(one, {{0}, 1}));
  outbox.forget();
  give_back(first, held(one, {{0}, 1}));
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
  EXPECT_EQ(taken_lease(first), (RunRange{{1}, 1}));
  EXPECT_EQ(taken_lease(third), (RunRange{{2}, 1}));
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
