// The service over real sockets, with workers that the test plays itself.

#include "coordinator/net/service.hpp"

#include <gmock/gmock.h>

#include "coordinator/dispatch/state.hpp"
#include "tests/coordinator/net/service_fixture.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using test::PlayingWorker;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class ServiceWorkers : public test::ServiceTest {};

TEST_F(ServiceWorkers, WaitForNoCommitWithOthersOnceAllResultsAreThere) {
  config.writer.commit_after = std::chrono::hours(1);
  config.writer.record_after = std::chrono::hours(1);
  start({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  EXPECT_THAT(wire::runs_of(worker.receive<proto::ResultAck>()), ElementsAre(RunIndex{0}));
}

TEST_F(ServiceWorkers, HearTheEpochOfEachCoordinator) {
  start({test::campaign_of("a", 3)});
  PlayingWorker worker(endpoint.address());
  (void)worker.register_here();
  const wire::Epoch first = worker.epoch;
  end(StopRequest::now);
  start({test::campaign_of("a", 3)});
  (void)worker.register_here();
  EXPECT_NE(first.value, 0U);
  EXPECT_NE(worker.epoch, first);
}

// As many as were computed while no coordinator was there arrive at once.
TEST_F(ServiceWorkers, KeepResultsThatSayNothingOfTheRate) {
  start({test::campaign_of("a", 3)});
  PlayingWorker worker(endpoint.address());
  const proto::RunLease kept = worker.borrow();
  kill();
  start({test::campaign_of("a", 3)});
  (void)worker.register_here();
  worker.deliver(kept);
  (void)worker.receive<proto::ResultAck>();
  worker.want(1);
  const auto other = worker.receive<proto::RunLease>();
  const auto campaign = [this] {
    proto::CampaignStatus status;
    in_service([&] { status = service->campaigns().front(); });
    return status;
  };
  EXPECT_EQ(campaign().num_done(), 1U);
  EXPECT_EQ(campaign().rate_hz(), 0.0);
  EXPECT_FALSE(campaign().has_remaining_s());
  worker.deliver(other);
  (void)worker.receive<proto::ResultAck>();
  EXPECT_EQ(campaign().num_done(), 2U);
  EXPECT_GT(campaign().rate_hz(), 0.0);
}

TEST_F(ServiceWorkers, AreToldToRegisterIfTheyMeanAnotherCoordinator) {
  start({test::campaign_of("a", 3)});
  PlayingWorker worker(endpoint.address());
  (void)worker.register_here();
  const wire::Epoch ours = worker.epoch;
  worker.epoch = {ours.value + 1};
  worker.want(1);
  EXPECT_EQ(worker.receive<proto::Reject>().reason(), proto::REJECT_REASON_NOT_REGISTERED);
  worker.epoch = ours;
  worker.want(1);
  EXPECT_EQ(wire::runs_of(worker.receive<proto::RunLease>()).count, 1U);
}

TEST_F(ServiceWorkers, KeepTheirRunsOnANewConnection) {
  start({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  const proto::RunLease lease = worker.borrow();
  worker.reconnect();
  EXPECT_TRUE(worker.is_lent_nothing({PlayingWorker::held(lease)}));
  worker.deliver(lease);
  EXPECT_THAT(wire::runs_of(worker.receive<proto::ResultAck>()), ElementsAre(RunIndex{0}));
  in_service([&] { EXPECT_EQ(service->campaigns().front().num_duplicates(), 0U); });
}

TEST_F(ServiceWorkers, ThatAreNotHeardAnyMoreAreReplacedWhenTheirProcessEnded) {
  start({test::campaign_of("a", 1)});
  (void)PlayingWorker(endpoint.address(), 1001).borrow();
  in_service([&] {
    EXPECT_FALSE(service->worker_of(1002));
    const auto worker = service->worker_of(1001);
    ASSERT_TRUE(worker);
    EXPECT_THAT(runs_held_text(service->state(), *worker), HasSubstr("0"));
    service->worker_ended(*worker, LossReason::crashed);
  });
  const proto::RunLease lease = PlayingWorker(endpoint.address(), 1002).borrow();
  EXPECT_EQ(wire::runs_of(lease), (RunRange{{0}, 1}));
  EXPECT_EQ(lease.attempt(), 2U);
}

TEST_F(ServiceWorkers, AreNotWaitedForAfterACoordinatorThatEndedInOrder) {
  start({test::campaign_of("a", 1)});
  (void)PlayingWorker(endpoint.address(), 1001).borrow();
  end(StopRequest::now);
  config.dispatch.reattach_wait = std::chrono::hours(1);
  start({test::campaign_of("a", 1)});
  EXPECT_EQ(PlayingWorker(endpoint.address(), 1002).borrow().num_runs(), 1U);
}

TEST_F(ServiceWorkers, HaveSoMuchTimeAndNoMoreWhenDrained) {
  config.drain_max = Duration::zero();
  start({test::campaign_of("a", 5)});
  PlayingWorker worker(endpoint.address());
  (void)worker.borrow();
  stop = StopRequest::drain;
  (void)worker.receive<proto::Stop>();
  wait_for_end();
}

TEST_F(ServiceWorkers, AreNotLentRunsThatWereGivenUp) {
  {
    ServedCampaign campaign = files.open(test::campaign_of("a", 1), {}, {});
    const Entry given_up = GivenUpRun{.run = {0}};
    (void)campaign.store.write({&given_up, 1});
  }
  start({test::campaign_of("a", 1)});
  in_service([&] {
    EXPECT_TRUE(service->is_done());
    EXPECT_EQ(service->campaigns().front().num_given_up(), 1U);
  });
}

class ServiceStorage : public test::ServiceTest {};

// Nothing is acknowledged, nothing lost; all goes on when the disk has room again.
TEST_F(ServiceStorage, FailsAndRecovers) {
  config.writer.retry_after = std::chrono::milliseconds(10);
  start({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  const proto::RunLease lease = worker.borrow();
  {
    const test::FileSizeLimit limit(1);
    worker.deliver(lease);
    (void)wait_for_event("storage_failed");
    in_service([&] {
      EXPECT_THAT(service->campaigns().front().storage_failure(), HasSubstr("a.db"));
      EXPECT_EQ(service->campaigns().front().num_done(), 0U);
    });
  }
  EXPECT_THAT(wire::runs_of(worker.receive<proto::ResultAck>()), ElementsAre(RunIndex{0}));
  (void)wait_for_event("storage_recovered");
  in_service([&] { EXPECT_EQ(service->campaigns().front().storage_failure(), ""); });
  end(StopRequest::now);
  EXPECT_EQ(num_stored("a"), 1U);
}

class ServiceStart : public test::ServiceTest {
 protected:
  std::string refusal() {
    try {
      start({});
    } catch (const Error& error) {
      return error.what();
    }
    return "started";
  }
};

TEST_F(ServiceStart, RefusesAnAddressThatOthersCanReachUnlessTheUserInsists) {
  config.workers_endpoint = "tcp://0.0.0.0:*";
  EXPECT_THAT(refusal(), StartsWith("bind = tcp://0.0.0.0:* ("));
  config.workers_endpoint = endpoint.address();
  config.clients_endpoint = "tcp://0.0.0.0:*";
  EXPECT_THAT(refusal(), StartsWith("bind-clients = tcp://0.0.0.0:* ("));
  config.is_plain_waived = true;
  EXPECT_EQ(refusal(), "started");
}

TEST_F(ServiceStart, SaysThatAnAddressIsTaken) {
  config.workers_endpoint = "tcp://127.0.0.1:*";
  start({});
  config.workers_endpoint = service->workers_endpoint();
  try {
    (void)Service({}, config, [](const Event&) {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.what(), "bind = " + config.workers_endpoint + " (Address already in use)");
  }
}

TEST_F(ServiceStart, SaysThatAnAddressIsOfAnotherMachine) {
  config.workers_endpoint = "tcp://nohost:1";
  config.is_plain_waived = true;
  EXPECT_EQ(refusal(),
            "bind = tcp://nohost:1 (must be *, an IP address of this machine or the name of an "
            "interface as lo)");
}

TEST_F(ServiceStart, RefusesTwoCampaignsOfOneName) {
  std::vector<ServedCampaign> campaigns;
  campaigns.push_back(files.open(test::campaign_of("a", 1), {}, {}));
  campaigns.push_back(files.open(test::campaign_of("b", 1), {}, {}));
  campaigns.back().definition = campaigns.front().definition;
  try {
    (void)Service(std::move(campaigns), config, [](const Event&) {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.what(), "campaign = a in " + (directory / "b.db").string() +
                                " (is served already, from another file)");
  }
}

}  // namespace
}  // namespace proofmass::coordinator
