#include "coordinator/net/service_snapshot.hpp"

#include <gtest/gtest.h>

#include <chrono>

namespace proofmass::coordinator {
namespace {

using namespace std::chrono_literals;

class ServiceSnapshotTest : public ::testing::Test {
 protected:
  Worker& add_worker(std::uint64_t id) {
    Worker& worker = state.workers[WorkerId{id}];
    worker.name = "w" + std::to_string(id);
    worker.host = {.key = "", .address = "10.0.0.7"};
    worker.host_name = "host";
    worker.registered_at = now - 100s;
    worker.heard_at = now - 1s;
    return worker;
  }

  TimePoint now{10'000s};
  State state;
};

TEST_F(ServiceSnapshotTest, TellsWhatEachWorkerDoes) {
  (void)add_worker(1);
  add_worker(2).num_lent = 5;
  Worker& silent = add_worker(3);
  silent.num_lent = 5;
  silent.heard_at = now - state.config.suspect_after - 1s;
  Worker& quarantined = add_worker(4);
  quarantined.host.address = "bad";
  quarantined.heard_at = silent.heard_at;
  state.quarantined[quarantined.host] = TimePoint::max();

  ServiceSnapshot snapshot;
  take_workers(state, now, snapshot);
  ASSERT_EQ(snapshot.workers.size(), 4U);
  EXPECT_EQ(snapshot.workers[0].activity, WorkerActivity::idle);
  EXPECT_EQ(snapshot.workers[1].activity, WorkerActivity::computing);
  EXPECT_EQ(snapshot.workers[2].activity, WorkerActivity::silent);
  EXPECT_EQ(snapshot.workers[3].activity, WorkerActivity::quarantined);
  EXPECT_EQ(snapshot.workers[1].status.name(), "w2");
  EXPECT_EQ(snapshot.workers[1].status.num_lent(), 5U);
  EXPECT_EQ(snapshot.workers[1].registered_s, 100.0);
  EXPECT_EQ(snapshot.workers[1].status.card_rate_hz(), 0.0);
}

TEST_F(ServiceSnapshotTest, HasTheSpeedOfCardsInTheirLatestCampaign) {
  Worker& worker = add_worker(1);
  worker.cards = "1 card";
  worker.card_work[CampaignId{7}] = {.since = now - 10s, .rate = 2000.0};
  worker.card_work[CampaignId{8}] = {.since = now - 90s, .rate = 500.0};
  const RegisteredWorker record = record_of(state, WorkerId{1}, worker, now);
  EXPECT_EQ(record.status.cards(), "1 card");
  EXPECT_EQ(record.status.card_rate_hz(), 2000.0);
}

TEST_F(ServiceSnapshotTest, CountsWorkersByActivity) {
  for (std::uint64_t id = 1; id <= 7; ++id) add_worker(id).num_lent = id % 2;
  ServiceSnapshot snapshot;
  take_workers(state, now, snapshot);
  const auto count = [&](WorkerActivity activity) {
    return snapshot.num_workers_by_activity[static_cast<std::size_t>(activity)];
  };
  EXPECT_EQ(count(WorkerActivity::computing), 4U);
  EXPECT_EQ(count(WorkerActivity::idle), 3U);
  EXPECT_EQ(count(WorkerActivity::silent), 0U);
}

}  // namespace
}  // namespace proofmass::coordinator
