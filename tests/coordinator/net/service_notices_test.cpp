// What an operator is told of campaigns that fail, by a service with workers that the test plays.

#include <gmock/gmock.h>

#include <future>
#include <string>

#include "coordinator/net/service.hpp"
#include "tests/coordinator/net/service_fixture.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using test::PlayingWorker;
using ::testing::HasSubstr;

class ServiceNotices : public test::ServiceTest {
 protected:
  ServiceNotices() {
    config.on_notice = [this](const CampaignNotice& notice) {
      if (num_notices_++ == 0) first_.set_value(notice);
    };
  }

  /// The first notice; the test fails if there is none after some time.
  CampaignNotice first_notice() {
    std::future<CampaignNotice> first = first_.get_future();
    const bool is_there = first.wait_for(std::chrono::seconds(20)) == std::future_status::ready;
    if (!is_there) throw Error("no notice");
    return first.get();
  }

  void expect_failure(const std::string& reason) {
    const CampaignNotice notice = first_notice();
    EXPECT_EQ(notice.campaign, "a");
    EXPECT_EQ(notice.file, directory / "a.db");
    EXPECT_THAT(notice.failure, HasSubstr(reason));
  }

 private:
  int num_notices_ = 0;  ///< In the service's thread.
  std::promise<CampaignNotice> first_;
};

TEST_F(ServiceNotices, TellOfACampaignThatWasCancelledForItsFailures) {
  plan.failures_max = 0;
  start({test::campaign_of("a", 2)});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow(), RunStatus::not_finite);
  expect_failure("1 runs have no estimate (at most 0 may be)");
}

TEST_F(ServiceNotices, TellOfResultsThatCannotBeStored) {
  config.writer.retry_after = std::chrono::milliseconds(10);
  start({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  const proto::RunLease lease = worker.borrow();
  const test::FileSizeLimit limit(1);
  worker.deliver(lease);
  expect_failure("a.db");
}

// The second worker is lent what the first one is thought not to deliver any more.
TEST_F(ServiceNotices, TellOfARunWithTwoResults) {
  start({test::campaign_of("a", 2)});
  PlayingWorker first(endpoint.address(), 1001);
  PlayingWorker second(endpoint.address(), 1002);
  const proto::RunLease lease = first.borrow();
  in_service([&] {
    const std::optional<WorkerId> worker = service->worker_of(1001);
    ASSERT_TRUE(worker.has_value());
    service->worker_ended(*worker, LossReason::silent);
  });
  const proto::RunLease again = second.borrow();
  ASSERT_EQ(wire::runs_of(again), wire::runs_of(lease));
  second.deliver(again);
  (void)second.receive<proto::ResultAck>();
  (void)first.register_here();
  first.deliver(lease, RunStatus::not_finite);
  expect_failure("1 runs were computed again with another result");
}

}  // namespace
}  // namespace proofmass::coordinator
