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

TEST_F(AuditTest, ThatIsLostIsLentAgain) {
  add_worker(second);
  complete(first, one, {0});
  on_bye(state, second, LossReason::preempted, now, outbox);
  outbox.forget();
  add_worker(third);
  EXPECT_EQ(state.workers.at(third).num_lent + state.workers.at(first).num_lent, 1U);
  EXPECT_EQ(campaign(one).audits.runs().size(), 1U);
  EXPECT_EQ(state.leases.at(*campaign(one).audits.find({0})).attempt, Attempt{3});
  outbox.forget();
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

// Results that come late, after the pattern of nasa/trick: #569, a result that arrives after its
// time-out puts the master into an endless loop; #1192, time-out and reassignment, and then both
// results arrive; #1369, after a late result the slave is never used again. Here, in every order.

/// What happens to run 0, which the first worker was lent.
enum class Step : std::uint8_t {
  expire,         ///< The first worker has been silent for too long.
  reassign,       ///< The second worker asks for runs.
  late_result,    ///< The first worker delivers.
  second_result,  ///< The second worker delivers, if it has been lent the run by then.
};
class LateResult : public DispatchFixture {
 protected:
  /// Another order: the first worker has been lent run 0.
  void begin_order() {
    outbox.forget();
    begin();
    waiting.clear();
    num_stores = 0;
    num_compared = 0;
    add_campaign(one, 3);
    add_busy_worker(first);
  }

  void happen(Step step) {
    switch (step) {
      case Step::expire:
        now += 60s;
        if (state.workers.contains(second)) heartbeat_of(second, held_by_second());
        on_tick(state, now, outbox);
        break;
      case Step::reassign:
        say_hello(second, hello());
        heartbeat_of(second, {});
        break;
      case Step::late_result:
        deliver(first, one, {0});
        break;
      case Step::second_result:
        if (is_lent_to_second()) deliver(second, one, {0}, 2);
        break;
    }
    commit_if_wanted();
    check_invariants(state);
    EXPECT_LE(num_stores, 1) << "stored twice";
  }

  void commit_if_wanted() {
    const Runs stored = outbox.take_stored();
    waiting.insert(waiting.end(), stored.begin(), stored.end());
    num_stores += std::count(stored.begin(), stored.end(), RunIndex{0});
    num_compared += outbox.take_compared().size();
    if (is_committed_at_once) commit_all();
  }

  void commit_all() {
    on_committed(state, one, waiting, now, outbox);
    waiting.clear();
  }

  bool is_lent_to_second() {
    const auto lease = campaign(one).lent.find({0});
    return lease && state.leases.at(*lease).worker == second;
  }

  std::vector<proto::HeldRuns> held_by_second() {
    std::vector<proto::HeldRuns> all;
    for (const LeaseId id : state.workers.at(second).leases) {
      const auto& lease = state.leases.at(id);
      all.push_back(make_held(one, lease.attempt, lease.remaining.ranges()));
    }
    return all;
  }

  void heartbeat_of(WorkerId id, const std::vector<proto::HeldRuns>& all) {
    on_heartbeat(state, id, make_heartbeat(4096, all), ++sequence, now, outbox);
  }

  /// A worker that has been given up says Hello again, and repeats what was not acknowledged. Then
  /// both are lent work, and finish it.
  void go_on();

  bool is_committed_at_once = false;
  Runs waiting;  ///< On their way to the store.
  std::int64_t num_stores = 0;
  std::uint64_t num_compared = 0;
};

void LateResult::go_on() {
  for (const WorkerId id : {first, second}) {
    say_hello(id, hello());
    heartbeat_of(id, {});
  }
  deliver(first, one, {0});
  commit_if_wanted();
  commit_all();
  EXPECT_EQ(num_stores, 1);
  EXPECT_TRUE(campaign(one).committed.contains({0}));
  EXPECT_EQ(campaign(one).num_duplicates, num_compared);

  for (int round = 0; round < 4; ++round) {
    for (const WorkerId id : {first, second}) {
      const auto leases = state.workers.at(id).leases;
      for (const LeaseId lease : leases) {
        if (!state.leases.contains(lease)) continue;
        const auto runs = state.leases.at(lease).remaining.ranges();
        for (const RunRange& range : runs) deliver(id, one, {range.first.value});
        commit_if_wanted();
        commit_all();
      }
    }
  }
  for (std::uint64_t i = 0; i < num_compared; ++i) {
    on_compared(state, one, {0}, first, true, now, outbox);
  }
  EXPECT_TRUE(is_finished(campaign(one)));
  EXPECT_TRUE(state.leases.empty());
  EXPECT_GT(state.workers.at(first).num_results, 0U);
  outbox.forget();
}

TEST_F(LateResult, IsStoredOnceAndBothWorkersGoOnInEveryOrder) {
  std::array order{Step::expire, Step::reassign, Step::late_result, Step::second_result};
  do {
    for (const bool at_once : {false, true}) {
      SCOPED_TRACE(testing::Message()
                   << "order " << testing::PrintToString(order) << ", " << at_once);
      is_committed_at_once = at_once;
      begin_order();
      for (const Step step : order) happen(step);
      go_on();
    }
  } while (std::next_permutation(order.begin(), order.end()));
}

}  // namespace
}  // namespace proofmass::test
