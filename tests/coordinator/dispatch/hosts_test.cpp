// What may be said about a host, and by whom; how many workers and hosts are kept.

#include <string>

#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

using namespace std::chrono_literals;
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
}

TEST_F(HostsTest, ACrashIsNotBelievedFromAnotherKey) {
  add_campaign(one, 10);
  join_and_take_runs(first, some_key);
  succeed(second, first, other_key);
  EXPECT_TRUE(state.workers.contains(first));
  EXPECT_EQ(num_crashes(some_key), 0U);
  EXPECT_TRUE(campaign(one).suspects.empty());
}

TEST_F(HostsTest, ACrashIsNotBelievedFromAnotherHost) {
  add_campaign(one, 10);
  join_and_take_runs(first, some_key);
  succeed(second, first, some_key, "elsewhere");
  EXPECT_TRUE(state.workers.contains(first));
  EXPECT_EQ(num_crashes(some_key), 0U);
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

}  // namespace
}  // namespace proofmass::test
