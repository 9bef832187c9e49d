#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/model.hpp"
#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

// Campaigns of several models. A model that computes something else stands for another one.

class ModelsTest : public DispatchFixture {
 protected:
  static constexpr std::uint64_t other_digest = 0xabcdef;

  void add_campaign_of_other_model(CampaignId id, std::uint64_t num_runs) {
    StoredCampaign stored = stored_campaign(num_runs);
    stored.reference_digest = other_digest;
    on_campaign(state, id, stored, now, outbox);
  }

  static proto::Hello hello_with_other(std::uint32_t num_slots, std::uint64_t digest) {
    proto::Hello said = hello(num_slots, "other-host");
    proto::OtherModel& other = *said.add_other_models();
    other.set_version(std::string(model_version));
    other.set_reference_digest(digest);
    other.set_description_digest(model().description_digest());
    return said;
  }

  void add_worker_with_other(WorkerId id, std::uint32_t num_slots) {
    add_worker(id, hello_with_other(num_slots, other_digest));
  }
};

// However long it takes: an idle worker that cannot help takes nothing off another one.
TEST_F(ModelsTest, AreNotCopiedToWorkersWithoutThem) {
  state.config.lease_duration_max = std::chrono::seconds(1);
  state.config.hung_after_min = std::chrono::seconds(1);
  add_campaign_of_other_model(one, 100);
  campaign(one).run_time_s = 1.0;
  add_worker_with_other(second, 4);
  EXPECT_EQ(taken_lease(second), (RunRange{{0}, 8})) << "one round to compute, one to wait";
  add_worker(first, 4);
  for (int i = 0; i < 10; ++i) {
    now += std::chrono::seconds(4);
    heartbeat(second, {held(one, {{0}, 8})});
    heartbeat(first);
    on_tick(state, now, outbox);
  }
  EXPECT_EQ(runs_held_text(state, first), "none");
  EXPECT_EQ(runs_held_text(state, second), "0..7");
}

// Its worker ends one that takes longer than its description allows, which may be a day.
TEST_F(ModelsTest, ThatAreProgramsAreNotTakenForHung) {
  add_campaign_of_other_model(one, 100);
  add_worker_with_other(first, 4);
  campaign(one).model.description_digest = 1;
  for (int i = 0; i < 1000; ++i, now += std::chrono::seconds(5)) {
    heartbeat(first, {held(one, {{0}, 8})}, {make_computed_batch(one, {{{0}, 1}}, 0)});
    on_tick(state, now, outbox);
    outbox.forget();
  }
  EXPECT_TRUE(state.workers.contains(first));
}

TEST_F(ModelsTest, MustComputeWhatTheyDidWhereTheCampaignBegan) {
  add_campaign_of_other_model(one, 10);
  say_hello(first, hello_with_other(1, 0x123));
  const auto reject = outbox.take_sent<proto::Reject>(first);
  EXPECT_EQ(reject.reason(), proto::REJECT_REASON_INCOMPATIBLE);
  EXPECT_EQ(reject.text(),
            "reference_digest of " + std::string(model_version) +
                " = 0000000000000123 (must be 0000000000abcdef, where its campaign "
                "began; a model that has changed needs another version, machines that "
                "differ need tolerate_digest = true)");
  EXPECT_FALSE(state.workers.contains(first));
  (void)outbox.take_events();
  // The other campaign of this version began with it.
  StoredCampaign stored = stored_campaign(1);
  stored.reference_digest = 0x123;
  on_campaign(state, two, stored, now, outbox);
  say_hello(first, hello_with_other(1, 0x123));
  outbox.drop_sent<proto::Welcome>(first);
  (void)outbox.take_events();
}

// Its worker lives, and so does what else it computes.
TEST_F(ModelsTest, ThatCrashOutsideTheirWorkerCountAgainstTheirRunsAlone) {
  add_campaign(one, 4);
  add_worker(first, 4);
  outbox.forget();
  ASSERT_EQ(runs_held_text(state, first), "0..3");
  give_back(first, held(one, {{0}, 2}), LossReason::crashed);
  EXPECT_EQ(campaign(one).suspects.at({0}).num_crashes, 1U);
  EXPECT_EQ(campaign(one).suspects.at({1}).hosts.at({"", "host"}).num_alone, 0U) << "one of two";
  EXPECT_FALSE(campaign(one).suspects.contains({2}));
  EXPECT_EQ(state.hosts.at({"", "host"}).num_crashes, 0U);
  EXPECT_EQ(runs_held_text(state, first), "2..3");
  outbox.forget();
  deliver(first, one, {2, 3});
  EXPECT_TRUE(outbox.take_sent<proto::RunLease>(first).is_alone());
  give_back(first, held(one, {{0}, 1}, 2), LossReason::crashed);
  EXPECT_EQ(campaign(one).suspects.at({0}).hosts.at({"", "host"}).num_alone, 1U);
  outbox.forget();
}

TEST_F(ModelsTest, ThatCrashAgainAndAgainPauseAtTheirWorkerAndHinderNoOthers) {
  add_campaign_of_other_model(one, 100);
  add_worker_with_other(first, 1);
  for (std::uint32_t i = 1; i <= config.crashes_per_host_max; ++i) {
    EXPECT_TRUE(can_compute(state.workers.at(first), campaign(one))) << i;
    const auto& lease = state.leases.at(*state.workers.at(first).leases.begin());
    give_back(first, held(one, {lease.remaining.first(), 1}, lease.known_as.value),
              LossReason::crashed);
    on_tick(state, now, outbox);
  }
  EXPECT_FALSE(can_compute(state.workers.at(first), campaign(one)));
  EXPECT_TRUE(crashes_everywhere(state, campaign(one)));
  EXPECT_FALSE(lacks_workers(state, campaign(one)));
  EXPECT_EQ(outbox.take_events().back(), "campaign_paused_at_worker worker=1 name=w crashes=5");
  EXPECT_TRUE(campaign(one).suspects.empty()) << "a host that has never computed a run";
  outbox.forget();
  add_worker_with_other(second, 1);
  EXPECT_FALSE(crashes_everywhere(state, campaign(one))) << "another process may do better";
  outbox.forget();
  now += config.quarantine_duration;
  heartbeat(first);
  heartbeat(second);
  on_tick(state, now, outbox);
  EXPECT_TRUE(can_compute(state.workers.at(first), campaign(one)));
  outbox.forget();
}

TEST_F(ModelsTest, ThatFinishARunHaveNotCrashedInARow) {
  add_campaign_of_other_model(one, 100);
  add_worker_with_other(first, 1);
  give_back(first, held(one, {{0}, 1}), LossReason::crashed);
  EXPECT_EQ(campaign(one).outside_crashes.at(session_of(first)).num_in_a_row, 1U);
  deliver(first, one, {1});
  EXPECT_TRUE(campaign(one).outside_crashes.empty());
  outbox.forget();
}

TEST_F(ModelsTest, ThatCrashBecauseOfARunThatIsGivenUpDoNotCountForTheOthers) {
  state.config.lone_witness_wait = std::chrono::seconds(0);
  add_campaign(one, 2);
  add_worker(first);
  complete(first, one, {1});
  for (std::uint32_t attempt = 1; attempt <= config.crashes_per_run_max; ++attempt) {
    give_back(first, held(one, {{0}, 1}, attempt), LossReason::crashed);
    EXPECT_EQ(campaign(one).outside_crashes.at(session_of(first)).num_in_a_row, attempt);
  }
  on_tick(state, now, outbox);
  EXPECT_TRUE(campaign(one).given_up.contains({0}));
  EXPECT_TRUE(campaign(one).outside_crashes.empty());
  outbox.forget();
}

// A thread of the worker computes four times as many runs of another model together.
TEST_F(ModelsTest, TakeSeveralSlotsARunWhereOthersTakeOne) {
  const auto batch_size = static_cast<std::uint32_t>(model().batch_size());
  add_campaign(one, 100'000);
  proto::Hello said = hello(8 * batch_size);
  said.set_slots_per_thread(4 * batch_size);
  add_worker(first, said);
  EXPECT_EQ(taken_lease(first), (RunRange{{0}, 2 * batch_size}))
      << "a batch for each of two threads";
  EXPECT_EQ(state.num_idle_slots, 0U);
  deliver(first, one, {0});
  commit(one);
  outbox.drop_sent<proto::ResultAck>(first);
  EXPECT_EQ(taken_lease(first), (RunRange{{2 * batch_size}, 2 * batch_size + 1}))
      << "and another to wait";
}

}  // namespace
}  // namespace proofmass::test
