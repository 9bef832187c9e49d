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

TEST_F(ServiceWorkers, ComputeEveryRunOfACampaignAndAreStopped) {
  config.end = ServiceEnd::when_done;
  start({test::campaign_of("a", 1000)});
  PlayingWorker(endpoint.address()).work();
  wait_for_end();
  EXPECT_EQ(num_stored("a"), 1000U);
}

TEST_F(ServiceWorkers, AreServedAtAPortOnLoopback) {
  config.workers_endpoint = "tcp://127.0.0.1:*";
  start({test::campaign_of("a", 2)});
  EXPECT_THAT(service->workers_endpoint(), StartsWith("tcp://127.0.0.1:"));
  EXPECT_EQ(PlayingWorker(service->workers_endpoint()).borrow().first_run(), 0U);
}

TEST_F(ServiceWorkers, AreLentOnlyWhatIsMissing) {
  start({test::campaign_of("a", 3)});
  {
    PlayingWorker worker(endpoint.address());
    const proto::RunLease lease = worker.borrow();
    EXPECT_EQ(wire::runs_of(lease), (RunRange{{0}, 1}));
    worker.deliver(lease);
    EXPECT_THAT(wire::runs_of(worker.receive<proto::ResultAck>()), ElementsAre(RunIndex{0}));
  }
  end(StopRequest::now);
  start({test::campaign_of("a", 3)});
  EXPECT_EQ(PlayingWorker(endpoint.address(), 1002).borrow().first_run(), 1U);
}

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

TEST_F(ServiceWorkers, AreToldToRegisterIfTheyDidNot) {
  start({test::campaign_of("a", 3)});
  PlayingWorker worker(endpoint.address());
  worker.want(1);
  EXPECT_EQ(worker.receive<proto::Reject>().reason(), proto::REJECT_REASON_NOT_REGISTERED);
}

TEST_F(ServiceWorkers, KeepTheirRunsOnANewConnection) {
  start({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  const proto::RunLease lease = worker.borrow();
  worker.reconnect();
  EXPECT_TRUE(worker.is_lent_nothing({PlayingWorker::held(lease)}));
  worker.deliver(lease);
  EXPECT_THAT(wire::runs_of(worker.receive<proto::ResultAck>()), ElementsAre(RunIndex{0}));
  in_service([&] { EXPECT_EQ(service->campaigns().front().num_duplicates, 0U); });
}

TEST_F(ServiceWorkers, AreEachLentRunsOfTheirOwn) {
  start({test::campaign_of("a", 10)});
  PlayingWorker first(endpoint.address(), 1001);
  PlayingWorker second(endpoint.address(), 1002);
  const proto::RunLease lease = first.borrow();
  EXPECT_EQ(lease.first_run(), 0U);
  EXPECT_EQ(second.borrow().first_run(), wire::runs_of(lease).end());
  EXPECT_EQ(first.register_here().worker_id(), 1U);
  EXPECT_EQ(second.register_here().worker_id(), 2U);
}

TEST_F(ServiceWorkers, ThatAreNotHeardAnyMoreAreReplacedWhenTheirProcessEnded) {
  start({test::campaign_of("a", 1)});
  (void)PlayingWorker(endpoint.address(), 1001).borrow();
  in_service([&] {
    EXPECT_FALSE(service->worker_of(1002));
    const auto worker = service->worker_of(1001);
    ASSERT_TRUE(worker);
    EXPECT_THAT(service->runs_held_text(*worker), HasSubstr("0"));
    service->worker_ended(*worker, LossReason::crashed);
  });
  const proto::RunLease lease = PlayingWorker(endpoint.address(), 1002).borrow();
  EXPECT_EQ(wire::runs_of(lease), (RunRange{{0}, 1}));
  EXPECT_EQ(lease.attempt(), 2U);
}

TEST_F(ServiceWorkers, AreWaitedForByTheCoordinatorAfterOneThatWasKilled) {
  start({test::campaign_of("a", 1)});
  PlayingWorker faithful(endpoint.address(), 1001);
  const proto::RunLease lease = faithful.borrow();
  kill();

  config.dispatch.reattach_wait = std::chrono::hours(1);
  start({test::campaign_of("a", 1)});
  PlayingWorker other(endpoint.address(), 1002);
  (void)other.register_here();
  EXPECT_TRUE(other.is_lent_nothing());
  (void)faithful.register_here();
  faithful.want(1, {PlayingWorker::held(lease)});
  faithful.deliver(lease);
  EXPECT_THAT(wire::runs_of(faithful.receive<proto::ResultAck>()), ElementsAre(RunIndex{0}));
}

TEST_F(ServiceWorkers, AreNotWaitedForAfterACoordinatorThatEndedInOrder) {
  start({test::campaign_of("a", 1)});
  (void)PlayingWorker(endpoint.address(), 1001).borrow();
  end(StopRequest::now);
  config.dispatch.reattach_wait = std::chrono::hours(1);
  start({test::campaign_of("a", 1)});
  EXPECT_EQ(PlayingWorker(endpoint.address(), 1002).borrow().num_runs(), 1U);
}

// The next coordinator waits for those that held runs; they were not told to end.
TEST_F(ServiceWorkers, AreLeftToTheNextCoordinator) {
  start({test::campaign_of("a", 2)});
  PlayingWorker holder(endpoint.address(), 1001);
  const proto::RunLease lease = holder.borrow(1);
  end(StopRequest::leave);
  config.dispatch.reattach_wait = std::chrono::hours(1);
  start({test::campaign_of("a", 2)});
  PlayingWorker other(endpoint.address(), 1002);
  (void)other.register_here();
  EXPECT_TRUE(other.is_lent_nothing());
  holder.say_hello();
  for (proto::Envelope message = holder.next_message(); !message.has_welcome();
       message = holder.next_message()) {
    EXPECT_FALSE(message.has_stop());
  }
  holder.want(1, {PlayingWorker::held(lease)});
  holder.deliver(lease);
  EXPECT_EQ(wire::runs_of(holder.receive<proto::ResultAck>()).size(), lease.num_runs());
}

TEST_F(ServiceWorkers, DeliverWhatTheyHoldWhenDrained) {
  start({test::campaign_of("a", 5)});
  PlayingWorker worker(endpoint.address());
  const proto::RunLease lease = worker.borrow();
  stop = StopRequest::drain;
  (void)worker.receive<proto::Drain>();
  worker.deliver(lease);
  EXPECT_EQ(wire::runs_of(worker.receive<proto::ResultAck>()).size(), lease.num_runs());
  worker.send(test::make_bye(LossReason::drained));
  wait_for_end();
  EXPECT_EQ(num_stored("a"), lease.num_runs());
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

TEST_F(ServiceWorkers, AreLentRunsThatWereGivenUpIfThatIsAskedFor) {
  {
    ServedCampaign campaign = files.open(test::campaign_of("a", 1), {}, {});
    const Entry given_up = GivenUpRun{.run = {0}};
    (void)campaign.store.write({&given_up, 1});
  }
  config.given_up = GivenUpRuns::retry;
  start({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)worker.receive<proto::ResultAck>();
  in_service([&] { EXPECT_TRUE(service->is_done()); });
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
    EXPECT_EQ(service->campaigns().front().num_given_up, 1U);
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
      EXPECT_THAT(service->campaigns().front().storage_failure, HasSubstr("a.db"));
      EXPECT_EQ(service->campaigns().front().num_done, 0U);
    });
  }
  EXPECT_THAT(wire::runs_of(worker.receive<proto::ResultAck>()), ElementsAre(RunIndex{0}));
  (void)wait_for_event("storage_recovered");
  in_service([&] { EXPECT_EQ(service->campaigns().front().storage_failure, ""); });
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
