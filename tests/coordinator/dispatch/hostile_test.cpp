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
  HostileTest() { begin(); }

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
  on_hello(state, first, session_of(first), "", hello(), now, outbox);
  heartbeat(first, {held(one, {{0}, 2}, attempt_max)});
  EXPECT_EQ(runs_held_text(state, first), "0..1");
  outbox.forget();
  add_worker(second, 2);
  now += 16s;
  heartbeat(second);
  on_tick(state, now, outbox);  // The first is silent: its runs are copied.
  EXPECT_EQ(outbox.take_sent<wire::RunLease>(second).attempt, Attempt{attempt_max});
  outbox.forget();
  crash(first);
  deliver(second, one, {0, 1}, attempt_max);
  EXPECT_EQ(outbox.take_stored().size(), 2U);
}

TEST_F(HostileTest, ARunIsListedTwice) {
  add_campaign(one, 10);
  on_hello(state, first, session_of(first), "", hello(), now, outbox);
  heartbeat(first, {held(one, {{0}, 4}), held(one, {{2}, 4}, 2), held(one, {{0}, 10}, 3)});
  check_invariants(state);
  EXPECT_EQ(state.workers.at(first).num_lent, 10U);
  heartbeat(first, {held(one, {{5}, 1}), held(one, {{5}, 1}, 9)},
            {{one, {{{5}, 1}, {{5}, 1}}, 1}, {one, {{{0}, 10}}, 2}});
  check_invariants(state);
  now += 20s;
  heartbeat(first, {held(one, {{5}, 1}, 9)});
}

TEST_F(HostileTest, WhatIsSetAsideIsHeldAndComputedAsWell) {
  add_campaign(one, 10);
  on_hello(state, first, session_of(first), "", hello(), now, outbox);
  wire::Heartbeat heartbeat{
      .num_runs_max = 4096, .held = {held(one, {{0}, 6})}, .computing = {{one, {{{0}, 6}}, 1}}};
  heartbeat.set_aside = {held(one, {{3}, 6}, 4), held(one, {{3}, 1}, 5), held(two, {{0}, 1})};
  on_heartbeat(state, first, heartbeat, 1, now, outbox);
  check_invariants(state);
  crash(first);
}

TEST_F(HostileTest, RunsAreGivenBackThatAreNotLent) {
  add_campaign(one, 10);
  add_worker(first);
  on_give_back(state, first,
               {.reason = LossReason::failed,
                .runs = {held(one, {{0}, num_runs_max}), held(one, {{0}, 1}), held(two, {{0}, 1}),
                         held(one, {{5}, 5}, attempt_max)}},
               now, outbox);
  check_invariants(state);
  on_bye(state, first, {.reason = LossReason::failed}, now, outbox);
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
  on_results(state, first, {.campaign = one, .attempt = {1}, .results = {slow}}, now, outbox);
  heartbeat(first, {held(one, {{1}, 1})}, {{one, {{{1}, 1}}, 1}});
  now += 5s;
  on_tick(state, now, outbox);
  EXPECT_TRUE(state.workers.contains(first));
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
