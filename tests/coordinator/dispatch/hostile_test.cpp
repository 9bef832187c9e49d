// Workers that are registered and say what cannot be. Nothing that they say may end the service:
// each test ends with a check of the state.

#include <limits>

#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

using namespace std::chrono_literals;

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

TEST_F(HostileTest, ARunIsListedTwice) {
  add_campaign(one, 10);
  say_hello(first, hello());
  heartbeat(first, {held(one, {{0}, 4}), held(one, {{2}, 4}, 2), held(one, {{0}, 10}, 3)});
  check_invariants(state);
  EXPECT_EQ(state.workers.at(first).num_lent, 10U);
  heartbeat(first, {held(one, {{5}, 1}), held(one, {{5}, 1}, 9)},
            {make_computed_batch(one, {{{5}, 1}, {{5}, 1}}, 1),
             make_computed_batch(one, {{{0}, 10}}, 2)});
  check_invariants(state);
  now += 20s;
  heartbeat(first, {held(one, {{5}, 1}, 9)});
}

TEST_F(HostileTest, WhatIsSetAsideIsHeldAndComputedAsWell) {
  add_campaign(one, 10);
  say_hello(first, hello());
  proto::Heartbeat heartbeat =
      make_heartbeat(4096, {held(one, {{0}, 6})}, {make_computed_batch(one, {{{0}, 6}}, 1)});
  for (const auto& runs : {held(one, {{3}, 6}, 4), held(one, {{3}, 1}, 5), held(two, {{0}, 1})}) {
    *heartbeat.add_set_aside() = runs;
  }
  on_heartbeat(state, first, heartbeat, 1, now, outbox);
  check_invariants(state);
  crash(first);
}

TEST_F(HostileTest, RunsAreGivenBackThatAreNotLent) {
  add_campaign(one, 10);
  add_worker(first);
  on_give_back(
      state, first,
      make_give_back(LossReason::failed, {held(one, {{0}, num_runs_max}), held(one, {{0}, 1}),
                                          held(two, {{0}, 1}), held(one, {{5}, 5}, attempt_max)}),
      now, outbox);
  check_invariants(state);
  on_bye(state, first, LossReason::failed, now, outbox);
  deliver(first, one, {0});
  EXPECT_TRUE(outbox.take_stored().empty()) << "it is not registered any more";
}

TEST_F(HostileTest, AResultIsInItsBatchTwice) {
  add_campaign(one, 10);
  add_worker(first);
  outbox.forget();
  deliver(first, one, {0, 0, 1, 0, 99, 99});
  EXPECT_EQ(outbox.take_stored(), (Runs{{0}, {1}}));
  deliver(first, one, {0, 0});
  EXPECT_TRUE(outbox.take_compared().empty()) << "they are repeated";
}

// Times that a worker claims are the only clock of its batches.
TEST_F(HostileTest, RunsTakeForEver) {
  add_campaign(one, 10);
  add_worker(first);
  wire::ComputedRun slow = computed(0);
  slow.elapsed_s = 1e300;
  on_results(state, first, one, {1}, {slow}, now, outbox);
  heartbeat(first, {held(one, {{1}, 1})}, {make_computed_batch(one, {{{1}, 1}}, 1)});
  now += 5s;
  on_tick(state, now, outbox);
  EXPECT_TRUE(state.workers.contains(first));
}

// One heartbeat once kept a whole new campaign from all others.
TEST_F(HostileTest, RunsAreClaimedThatWereNeverLent) {
  add_campaign(one, 2000);
  const WorkerId stranger{7};
  say_hello(stranger, hello(1, "elsewhere"));
  proto::Heartbeat heartbeat = make_heartbeat(0, {held(one, {{0}, 2000})});
  *heartbeat.add_set_aside() = held(one, {{0}, 2000}, 2);
  on_heartbeat(state, stranger, heartbeat, 1, now, outbox);
  EXPECT_TRUE(state.leases.empty());
  on_removed(state, one, outbox);
  add_campaign(one, 2000);
  EXPECT_TRUE(state.leases.empty()) << "nor later, of what is set aside";
}

TEST_F(HostileTest, WhatWasLentBeforeMayBeClaimedAndNoMore) {
  add_campaign(one, 10);
  const WorkerId stranger{7};
  add_worker(stranger, 4, "elsewhere");
  on_gone(state, stranger, LossReason::silent, now, outbox);
  say_hello(stranger, hello(4, "elsewhere"));
  on_heartbeat(state, stranger, make_heartbeat(0, {held(one, {{0}, 10})}), 9, now, outbox);
  EXPECT_EQ(runs_held_text(state, stranger), "0..3");
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
  add_worker(first);
  outbox.forget();
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

TEST_F(HostileTest, ACampaignIsRemovedAndAddedWhileAResultIsCompared) {
  add_campaign(one, 2);
  add_worker(first);
  complete(first, one, {0});
  deliver(first, one, {0});
  ASSERT_EQ(outbox.take_compared().size(), 1U);
  on_removed(state, one, outbox);
  add_campaign(one, 2);
  on_compared(state, one, {0}, first, true, now, outbox);
  EXPECT_EQ(campaign(one).num_comparing, 0U);
}

}  // namespace
}  // namespace proofmass::test
