#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

// Runs that are computed a second time, by another worker, and compared.

using coordinator::is_audited;

class AuditTest : public DispatchFixture {
 protected:
  void SetUp() override {
    add_campaign(one, 1, 0, 1.0);
    add_busy_worker(first);
  }
};

TEST(Audit, ChoosesAFractionOfRunsAlwaysTheSame) {
  constexpr std::uint64_t num_runs = 100'000;
  for (const double fraction : {0.0, 0.01, 0.5, 1.0}) {
    std::uint64_t count = 0;
    for (RunIndex run; run.value < num_runs; ++run.value) {
      const bool is_chosen = is_audited(7, run, fraction);
      EXPECT_EQ(is_chosen, is_audited(7, run, fraction));
      if (is_chosen) ++count;
    }
    // A binomial count: within five standard deviations.
    const double expected = fraction * num_runs;
    EXPECT_NEAR(static_cast<double>(count), expected, 5.0 * std::sqrt(expected * (1.0 - fraction)));
  }
}

TEST(Audit, ChoosesOtherRunsUnderAnotherSeed) {
  int num_different = 0;
  for (RunIndex run; run.value < 1000; ++run.value) {
    if (is_audited(1, run, 0.5) != is_audited(2, run, 0.5)) ++num_different;
  }
  EXPECT_NEAR(num_different, 500, 80);
}

TEST_F(AuditTest, GoesToAnotherWorker) {
  add_busy_worker(second);
  deliver(first, one, {0});
  commit(one);
  (void)outbox.take_sent<proto::ResultAck>(first);
  const auto lease = outbox.take_sent<proto::RunLease>(second);
  EXPECT_EQ(wire::runs_of(lease), (RunRange{{0}, 1}));
  EXPECT_EQ(lease.attempt(), 2U);
  EXPECT_FALSE(is_finished(campaign(one)));

  deliver(second, one, {0}, 2);
  EXPECT_EQ(wire::runs_of(outbox.take_sent<proto::ResultAck>(second)), Runs{{0}});
  EXPECT_EQ(outbox.take_compared(), Runs{{0}});
  EXPECT_TRUE(state.leases.empty());
  EXPECT_FALSE(is_finished(campaign(one)));
  EXPECT_FALSE(is_quiet(state));
  EXPECT_EQ(campaign(one).num_duplicates, 0U);

  on_compared(state, one, {0}, second, true, now, outbox);
  EXPECT_TRUE(is_finished(campaign(one)));
  EXPECT_TRUE(is_quiet(state));
  outbox.forget();
}

TEST_F(AuditTest, IsNotDoneByAFirstWorkerThatRepeatsItself) {
  add_worker(second);
  deliver(first, one, {0});
  commit(one);
  deliver(first, one, {0});
  EXPECT_EQ(campaign(one).audits.runs().size(), 1U);
  EXPECT_EQ(campaign(one).num_duplicates, 1U);
  outbox.forget();
}

TEST_F(AuditTest, ReportsAndCountsWhatDiffersAmongWhatItCompared) {
  add_worker(second);
  deliver(first, one, {0});
  commit(one);
  deliver(second, one, {0}, 2);
  outbox.forget();
  on_compared(state, one, {0}, second, false, now, outbox);
  EXPECT_EQ(outbox.take_events().at(0), "result_mismatch run=0 worker=2");
  EXPECT_EQ(campaign(one).num_audited, 1U);
  EXPECT_EQ(campaign(one).num_mismatches, 1U);
  EXPECT_EQ(campaign(one).phase, coordinator::Phase::finished);
  outbox.forget();
}

TEST_F(AuditTest, WaitsForAnotherWorkerThatIsBusy) {
  add_worker(second);
  heartbeat(second, {}, {}, 0);
  outbox.forget();
  deliver(first, one, {0});
  commit(one);
  (void)outbox.take_sent<proto::ResultAck>(first);
  outbox.expect_nothing_more();
  heartbeat(second);
  (void)outbox.take_sent<proto::RunLease>(second);
}

TEST_F(AuditTest, GoesToTheSameWorkerIfThereIsNoOther) {
  deliver(first, one, {0});
  commit(one);
  (void)outbox.take_sent<proto::ResultAck>(first);
  EXPECT_EQ(outbox.take_sent<proto::RunLease>(first).attempt(), 2U);
}

TEST_F(AuditTest, ThatCrashesEveryWorkerIsGivenUp) {
  add_worker(second);
  complete(first, one, {0});
  Strings events;
  for (int i = 0; i < 8 && !campaign(one).audits.empty(); ++i) {
    const WorkerId id = state.leases.at(*campaign(one).audits.find({0})).worker;
    state.hosts.at({"", "host"}).num_crashes = 0;
    crash(id);
    events = outbox.take_events();
    outbox.forget();
    add_busy_worker(id);
  }
  EXPECT_TRUE(campaign(one).suspects.empty());
  EXPECT_TRUE(is_finished(campaign(one)));
  EXPECT_EQ(events.at(1), "audit_given_up run=0 crashes=3");
}

TEST_F(AuditTest, OfWhatWasStoredBeforeTheRestartIsDoneByAnybody) {
  StoredCampaign stored = stored_campaign(3);
  stored.control.audit_fraction = 1.0;
  stored.finished = {{{0}, 3}};
  stored.compared = {{{1}, 1}};
  on_campaign(state, two, stored, now, outbox);
  EXPECT_EQ(campaign(two).audits.runs().size() + campaign(two).num_to_audit, 2U);
  EXPECT_FALSE(campaign(two).audits.runs().contains({1}));
  outbox.forget();
}

TEST_F(AuditTest, OfAFinishedCampaignIsNotDoneAgain) {
  StoredCampaign stored = stored_campaign(3);
  stored.control.audit_fraction = 1.0;
  stored.control.phase = coordinator::Phase::finished;
  stored.finished = {{{0}, 3}};
  on_campaign(state, two, stored, now, outbox);
  EXPECT_TRUE(is_finished(campaign(two)));
}

}  // namespace
}  // namespace proofmass::test
