#include "coordinator/dispatch/dispatch.hpp"

#include <gtest/gtest.h>

#include "core/simulation/run.hpp"
#include "tests/coordinator/dispatch/recording_outbox.hpp"

namespace proofmass::coordinator {
namespace {

using namespace std::chrono_literals;
using Strings = std::vector<std::string>;
using Runs = std::vector<RunIndex>;

constexpr WorkerId first{1};
constexpr WorkerId second{2};

wire::Hello hello(const std::string& name) {
  return {.worker_name = name,
          .host = "host",
          .process_id = 100,
          .num_slots = 1,
          .model_version = std::string(model_version)};
}

wire::ComputedRun computed(std::uint64_t run, RunStatus status = RunStatus::completed) {
  wire::ComputedRun result;
  result.result.run = {run};
  result.result.status = status;
  result.compute_s = 1000.0;  // So long that no more than two rounds are lent.
  return result;
}

wire::ResultBatch batch(const wire::RunLease& lease, const std::vector<std::uint64_t>& runs) {
  wire::ResultBatch batch{.lease = lease.lease, .attempt = lease.attempt, .results = {}};
  for (const std::uint64_t run : runs) batch.results.push_back(computed(run));
  return batch;
}

/// A campaign and what the dispatch does about it. Each test ends with a check of the state and
/// that nothing was sent, stored or logged that the test has not named.
class DispatchTest : public testing::Test {
 protected:
  void begin(std::uint64_t num_runs, const std::vector<RunRange>& finished = {}) {
    Campaign campaign;
    campaign.num_runs = num_runs;
    state = initial_state(std::make_shared<const Campaign>(campaign), finished, {});
  }

  void register_worker(WorkerId id, const std::string& name) {
    on_hello(state, id, hello(name), now, outbox);
    (void)outbox.take_sent<wire::Welcome>(id);
    (void)outbox.take_events();
  }

  wire::RunLease give_credit(WorkerId id) {
    on_credit(state, id, {.num_runs_max = 4096}, now, outbox);
    return outbox.take_sent<wire::RunLease>(id);
  }

  /// All runs that were handed to the store become durable.
  void commit() { on_committed(state, outbox.take_stored(), outbox); }

  void TearDown() override {
    outbox.expect_nothing_more();
    check_invariants(state);
  }

  State state;
  test::RecordingOutbox outbox;
  TimePoint now{};
};

TEST_F(DispatchTest, WelcomesAWorkerWithTheCampaign) {
  begin(10);
  on_hello(state, first, hello("w"), now, outbox);
  const auto welcome = outbox.take_sent<wire::Welcome>(first);
  EXPECT_EQ(welcome.worker, first);
  EXPECT_EQ(welcome.campaign, state.campaign);
  EXPECT_EQ(welcome.heartbeat_interval_s, 2.0);
  EXPECT_EQ(outbox.take_events(),
            Strings{"worker_registered worker=1 name=w host=host pid=100 slots=1"});
}

TEST_F(DispatchTest, AnswersARepeatedHelloAndKeepsTheLeases) {
  begin(10);
  register_worker(first, "w");
  (void)give_credit(first);
  on_hello(state, first, hello("w"), now, outbox);
  (void)outbox.take_sent<wire::Welcome>(first);
  EXPECT_EQ(state.leases.size(), 1U);
}

TEST_F(DispatchTest, RefusesAnotherModel) {
  begin(10);
  wire::Hello other = hello("w");
  other.model_version = "older";
  on_hello(state, first, other, now, outbox);
  const auto reject = outbox.take_sent<wire::Reject>(first);
  EXPECT_EQ(reject.reason, wire::RejectReason::incompatible);
  const std::string text =
      "model_version = older (must be " + std::string(model_version) + ", the coordinator's)";
  EXPECT_EQ(reject.text, text);
  EXPECT_EQ(outbox.take_events(), Strings{"worker_refused name=w " + text});
  EXPECT_TRUE(state.workers.empty());
}

TEST_F(DispatchTest, RefusesMoreWorkersThanItServes) {
  begin(10);
  state.config.num_workers_max = 1;
  register_worker(first, "w");
  on_hello(state, second, hello("v"), now, outbox);
  const auto reject = outbox.take_sent<wire::Reject>(second);
  EXPECT_EQ(reject.reason, wire::RejectReason::full);
  EXPECT_EQ(reject.text, "number of workers = 1 (no more are served)");
  EXPECT_EQ(outbox.take_events(),
            Strings{"worker_refused name=v number of workers = 1 (no more are served)"});
}

TEST_F(DispatchTest, TellsAStrangerToRegister) {
  begin(10);
  on_credit(state, first, {.num_runs_max = 1}, now, outbox);
  EXPECT_EQ(outbox.take_sent<wire::Reject>(first).reason, wire::RejectReason::not_registered);
  on_heartbeat(state, first, {}, now, outbox);
  EXPECT_EQ(outbox.take_sent<wire::Reject>(first).reason, wire::RejectReason::not_registered);
  on_results(state, first, {.lease = {1}, .attempt = {1}, .results = {computed(0)}}, now, outbox);
  EXPECT_EQ(outbox.take_sent<wire::Reject>(first).reason, wire::RejectReason::not_registered);
  on_bye(state, first, now, outbox);
}

TEST_F(DispatchTest, LendsTheFirstRunsOnCredit) {
  begin(10);
  register_worker(first, "w");
  const wire::RunLease lease = give_credit(first);
  EXPECT_EQ(lease.runs, (RunRange{{0}, 1}));
  EXPECT_EQ(lease.attempt, Attempt{1});
  EXPECT_TRUE(lease.table_values.empty());
}

TEST_F(DispatchTest, LendsNothingWithoutCredit) {
  begin(10);
  register_worker(first, "w");
  on_credit(state, first, {.num_runs_max = 0}, now, outbox);
}

TEST_F(DispatchTest, LendsNothingMoreWhenCreditIsRepeated) {
  begin(10);
  register_worker(first, "w");
  (void)give_credit(first);
  on_credit(state, first, {.num_runs_max = 4096}, now, outbox);
}

TEST_F(DispatchTest, LendsOnlyWhatIsNotFinished) {
  begin(10, {{{0}, 4}, {{5}, 5}});
  register_worker(first, "w");
  EXPECT_EQ(give_credit(first).runs, (RunRange{{4}, 1}));
}

TEST_F(DispatchTest, AcknowledgesAfterTheCommitAndNotBefore) {
  begin(10);
  register_worker(first, "w");
  const wire::RunLease lease = give_credit(first);

  on_results(state, first, batch(lease, {0}), now, outbox);
  ASSERT_EQ(outbox.stored().size(), 1U);
  EXPECT_EQ(outbox.stored()[0].worker, first);
  EXPECT_EQ(outbox.stored()[0].attempt, Attempt{1});
  EXPECT_EQ(outbox.take_sent<wire::RunLease>(first).runs, (RunRange{{1}, 2}));

  on_committed(state, outbox.take_stored(), outbox);
  EXPECT_EQ(outbox.take_sent<wire::ResultAck>(first).runs, Runs{{0}});
}

TEST_F(DispatchTest, AcknowledgesARepeatedResultAgainOnceItIsDurable) {
  begin(2);
  register_worker(first, "w");
  const wire::RunLease lease = give_credit(first);
  on_results(state, first, batch(lease, {0}), now, outbox);
  (void)outbox.take_sent<wire::RunLease>(first);
  on_results(state, first, batch(lease, {0}), now, outbox);  // Before the commit: nothing yet.
  commit();
  EXPECT_EQ(outbox.take_sent<wire::ResultAck>(first).runs, Runs{{0}});
  on_results(state, first, batch(lease, {0}), now, outbox);
  EXPECT_EQ(outbox.take_sent<wire::ResultAck>(first).runs, Runs{{0}});
  EXPECT_EQ(state.num_duplicates, 2U);
}

TEST_F(DispatchTest, StopsAllWorkersWithTheLastCommit) {
  begin(1);
  register_worker(first, "w");
  register_worker(second, "v");
  const wire::RunLease lease = give_credit(first);
  on_credit(state, second, {.num_runs_max = 4096}, now, outbox);
  on_results(state, first, batch(lease, {0}), now, outbox);
  EXPECT_FALSE(is_finished(state));
  commit();
  EXPECT_TRUE(is_finished(state));
  (void)outbox.take_sent<wire::ResultAck>(first);
  (void)outbox.take_sent<wire::Stop>(first);
  (void)outbox.take_sent<wire::Stop>(second);
  EXPECT_EQ(outbox.take_events(), Strings{"campaign_finished runs=1 duplicates=0"});
}

TEST_F(DispatchTest, LendsASilentWorkersRunsAgainUnderAHigherAttempt) {
  begin(1);
  register_worker(first, "w");
  (void)give_credit(first);
  now += 29s;
  register_worker(second, "v");
  on_credit(state, second, {.num_runs_max = 4096}, now, outbox);
  on_tick(state, now, outbox);
  outbox.expect_nothing_more();

  now += 1s;
  on_tick(state, now, outbox);
  const auto lease = outbox.take_sent<wire::RunLease>(second);
  EXPECT_EQ(lease.runs, (RunRange{{0}, 1}));
  EXPECT_EQ(lease.attempt, Attempt{2});
  EXPECT_EQ(outbox.take_events(), (Strings{"worker_gone worker=1 name=w reason=silent orbits=0",
                                           "lease_expired worker=1 lease=1 runs=0 attempt=1"}));
}

TEST_F(DispatchTest, CountsAnyMessageAsASignOfLife) {
  begin(1);
  register_worker(first, "w");
  for (int i = 0; i < 3; ++i) {
    now += 20s;
    on_heartbeat(state, first, {.num_orbits_done = 5, .leases = {}}, now, outbox);
    (void)outbox.take_sent<wire::HeartbeatAck>(first);
    on_tick(state, now, outbox);
  }
  EXPECT_EQ(state.workers.at(first).num_orbits_done, 5U);
}

TEST_F(DispatchTest, TakesALateResultOfARunThatIsLentAgain) {
  begin(1);
  register_worker(first, "w");
  const wire::RunLease old = give_credit(first);
  now += 60s;
  on_tick(state, now, outbox);
  (void)outbox.take_events();
  register_worker(second, "v");
  const wire::RunLease fresh = give_credit(second);

  register_worker(first, "w");
  on_results(state, first, batch(old, {0}), now, outbox);
  ASSERT_EQ(outbox.stored().size(), 1U);
  EXPECT_EQ(outbox.stored()[0].attempt, Attempt{1});
  EXPECT_TRUE(state.leases.empty());

  on_results(state, second, batch(fresh, {0}), now, outbox);  // The same run: a duplicate.
  EXPECT_EQ(state.num_duplicates, 1U);
  commit();
  EXPECT_EQ(outbox.take_sent<wire::ResultAck>(first).runs, Runs{{0}});
  EXPECT_EQ(outbox.take_sent<wire::ResultAck>(second).runs, Runs{{0}});
  (void)outbox.take_sent<wire::Stop>(first);
  (void)outbox.take_sent<wire::Stop>(second);
  (void)outbox.take_events();
}

TEST_F(DispatchTest, TakesALateResultOfARunThatIsPendingAgain) {
  begin(2);
  register_worker(first, "w");
  const wire::RunLease old = give_credit(first);
  now += 60s;
  on_tick(state, now, outbox);
  (void)outbox.take_events();
  register_worker(first, "w");
  on_results(state, first, batch(old, {0}), now, outbox);
  EXPECT_EQ(outbox.take_stored(), Runs{{0}});
}

TEST_F(DispatchTest, TakesBackALeaseThatNeverArrived) {
  begin(1);
  register_worker(first, "w");
  (void)give_credit(first);
  now += 9s;
  on_heartbeat(state, first, {}, now, outbox);  // The lease may be under way.
  (void)outbox.take_sent<wire::HeartbeatAck>(first);
  outbox.expect_nothing_more();

  now += 1s;
  on_heartbeat(state, first, {}, now, outbox);
  (void)outbox.take_sent<wire::HeartbeatAck>(first);
  EXPECT_EQ(outbox.take_events(), Strings{"lease_expired worker=1 lease=1 runs=0 attempt=1"});
  const auto again = outbox.take_sent<wire::RunLease>(first);
  EXPECT_EQ(again.attempt, Attempt{2});

  now += 10s;
  on_heartbeat(state, first, {.num_orbits_done = 0, .leases = {again.lease}}, now, outbox);
  (void)outbox.take_sent<wire::HeartbeatAck>(first);
}

TEST_F(DispatchTest, LendsToOthersWhatALeavingWorkerHeld) {
  begin(1);
  register_worker(first, "w");
  (void)give_credit(first);
  register_worker(second, "v");
  on_credit(state, second, {.num_runs_max = 4096}, now, outbox);
  on_bye(state, first, now, outbox);
  EXPECT_EQ(outbox.take_sent<wire::RunLease>(second).attempt, Attempt{2});
  EXPECT_EQ(outbox.take_events(),
            (Strings{"worker_left worker=1", "lease_expired worker=1 lease=1 runs=0 attempt=1"}));
}

TEST_F(DispatchTest, KnowsWhatADeadProcessHeld) {
  begin(1);
  register_worker(first, "w");
  (void)give_credit(first);
  EXPECT_EQ(to_text(runs_held(state, first)), "0");
  on_gone(state, first, "process_ended", now, outbox);
  EXPECT_EQ(to_text(runs_held(state, first)), "none");
  EXPECT_EQ(outbox.take_events(),
            (Strings{"worker_gone worker=1 name=w reason=process_ended orbits=0",
                     "lease_expired worker=1 lease=1 runs=0 attempt=1"}));
}

TEST_F(DispatchTest, ClosesOutAWorkerWithARunOfAnotherCampaign) {
  begin(1);
  register_worker(first, "w");
  on_results(state, first, {.lease = {1}, .attempt = {1}, .results = {computed(0), computed(1)}},
             now, outbox);
  const auto reject = outbox.take_sent<wire::Reject>(first);
  EXPECT_EQ(reject.reason, wire::RejectReason::malformed);
  EXPECT_EQ(reject.text, "run = beyond the campaign (must be below num_runs)");
  EXPECT_EQ(outbox.take_events(),
            Strings{"worker_gone worker=1 name=w reason=foreign_run orbits=0"});
  EXPECT_TRUE(state.workers.empty());
}

TEST_F(DispatchTest, CountsRunsWithoutAnEstimate) {
  begin(3);
  register_worker(first, "w");
  on_results(state, first,
             {.lease = {1},
              .attempt = {1},
              .results = {computed(0, RunStatus::no_draw), computed(1, RunStatus::not_converged),
                          computed(2, RunStatus::not_finite)}},
             now, outbox);
  EXPECT_EQ(state.num_without_estimate, 2U);
  EXPECT_EQ(outbox.take_stored().size(), 3U);
}

TEST_F(DispatchTest, DrainsUntilWhatIsHeldIsStored) {
  begin(5);
  register_worker(first, "w");
  const wire::RunLease lease = give_credit(first);
  on_drain(state, outbox);
  (void)outbox.take_sent<wire::Drain>(first);
  on_credit(state, first, {.num_runs_max = 4096}, now, outbox);
  EXPECT_FALSE(is_quiet(state));
  on_results(state, first, batch(lease, {0}), now, outbox);
  EXPECT_FALSE(is_quiet(state));
  commit();
  (void)outbox.take_sent<wire::ResultAck>(first);
  EXPECT_TRUE(is_quiet(state));
  EXPECT_FALSE(is_finished(state));
}

TEST_F(DispatchTest, TellsWorkersToStopAndNewOnesToo) {
  begin(5);
  register_worker(first, "w");
  on_stop(state, outbox);
  (void)outbox.take_sent<wire::Stop>(first);
  on_hello(state, second, hello("v"), now, outbox);
  (void)outbox.take_sent<wire::Stop>(second);
}

}  // namespace
}  // namespace proofmass::coordinator
