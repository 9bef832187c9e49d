// How much a worker is lent at a time.

#include <gtest/gtest.h>

#include "core/simulation/run.hpp"
#include "tests/coordinator/dispatch/recording_outbox.hpp"

namespace proofmass::coordinator {
namespace {

constexpr WorkerId id{1};

wire::Hello hello(std::uint32_t num_slots) {
  return {.worker_name = "w",
          .host = "h",
          .process_id = 1,
          .num_slots = num_slots,
          .model_version = std::string(model_version)};
}

/// Runs of the leases that a worker holds after it delivered the first run.
std::vector<RunRange> lent_after_first_run(std::uint64_t num_runs, double run_time_s,
                                           std::uint32_t num_runs_max = 4096) {
  Campaign campaign;
  campaign.num_runs = num_runs;
  State state = initial_state(std::make_shared<const Campaign>(campaign), {}, {});
  test::RecordingOutbox outbox;
  on_hello(state, id, hello(1), {}, outbox);
  (void)outbox.take_sent<wire::Welcome>(id);
  on_credit(state, id, {.num_runs_max = num_runs_max}, {}, outbox);
  const auto lease = outbox.take_sent<wire::RunLease>(id);
  EXPECT_EQ(lease.runs, (RunRange{{0}, 1})) << "how long a run takes is not known yet";
  wire::ComputedRun computed;
  computed.compute_s = run_time_s;
  on_results(state, id, {.lease = lease.lease, .attempt = {1}, .results = {computed}}, {}, outbox);
  check_invariants(state);
  return runs_held(state, id).ranges();
}

TEST(Lending, GivesASecondAndAHalfOfWork) {
  EXPECT_EQ(lent_after_first_run(1'000'000, 0.01), (std::vector<RunRange>{{{1}, 150}}));
  EXPECT_EQ(lent_after_first_run(1'000'000, 1.0), (std::vector<RunRange>{{{1}, 2}}));
}

TEST(Lending, GivesOneRunToComputeAndOneToWaitIfRunsAreLong) {
  EXPECT_EQ(lent_after_first_run(1'000'000, 60.0), (std::vector<RunRange>{{{1}, 2}}));
}

TEST(Lending, GivesNoMoreThanALeaseMayHave) {
  EXPECT_EQ(lent_after_first_run(1'000'000, 1e-9), (std::vector<RunRange>{{{1}, 4096}}));
}

TEST(Lending, GivesNoMoreThanTheCredit) {
  EXPECT_EQ(lent_after_first_run(1'000'000, 0.01, 20), (std::vector<RunRange>{{{1}, 20}}));
}

TEST(Lending, GivesHalfOfAFairShareNearTheEnd) {
  EXPECT_EQ(lent_after_first_run(101, 0.001), (std::vector<RunRange>{{{1}, 50}}));
}

TEST(Lending, FillsAllSlotsOfAWorker) {
  Campaign campaign;
  campaign.num_runs = 10;
  State state = initial_state(std::make_shared<const Campaign>(campaign), {}, {});
  test::RecordingOutbox outbox;
  on_hello(state, id, hello(4), {}, outbox);
  on_credit(state, id, {.num_runs_max = 4096}, {}, outbox);
  EXPECT_EQ(runs_held(state, id).size(), 4U);
}

TEST(Lending, SendsTheTableValuesOfTheRuns) {
  Campaign campaign;
  campaign.num_runs = 3;
  campaign.dispersions[5] = {.law = Law::table, .file = "f", .column = "a"};
  campaign.dispersions[9] = {.law = Law::table, .file = "f", .column = "b"};
  campaign.table_columns = {{1.0, 2.0, 3.0}, {10.0, 20.0, 30.0}};
  const std::vector<RunRange> finished{{{0}, 1}};
  State state = initial_state(std::make_shared<const Campaign>(campaign), finished, {});
  test::RecordingOutbox outbox;
  on_hello(state, id, hello(2), {}, outbox);
  (void)outbox.take_sent<wire::Welcome>(id);
  on_credit(state, id, {.num_runs_max = 4096}, {}, outbox);
  EXPECT_EQ(outbox.take_sent<wire::RunLease>(id).table_values,
            (std::vector<double>{2.0, 20.0, 3.0, 30.0}));
}

// Runs that a lost worker held come before those that were never lent.
TEST(Lending, GivesRunsThatWereLentBeforeFirst) {
  Campaign campaign;
  campaign.num_runs = 10;
  State state = initial_state(std::make_shared<const Campaign>(campaign), {}, {});
  test::RecordingOutbox outbox;
  on_hello(state, id, hello(3), {}, outbox);
  on_credit(state, id, {.num_runs_max = 4096}, {}, outbox);
  on_bye(state, id, {}, outbox);
  on_hello(state, WorkerId{2}, hello(4), {}, outbox);
  on_credit(state, WorkerId{2}, {.num_runs_max = 4096}, {}, outbox);
  ASSERT_EQ(state.leases.size(), 2U);
  EXPECT_EQ(state.leases.at(LeaseId{2}).attempt, Attempt{2});
  EXPECT_EQ(to_text(state.leases.at(LeaseId{2}).remaining), "0..2");
  EXPECT_EQ(state.leases.at(LeaseId{3}).attempt, Attempt{1});
  EXPECT_EQ(to_text(state.leases.at(LeaseId{3}).remaining), "3");
  check_invariants(state);
}

}  // namespace
}  // namespace proofmass::coordinator
