// Campaigns that end before all of their runs are finished, over real sockets.

#include "core/error.hpp"
#include "proto/wire/names.hpp"
#include "tests/coordinator/net/service_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using wire::CampaignPhase;

class ServiceStop : public test::ServiceTest {
 protected:
  [[nodiscard]] Store file_of_a() const { return Store::open_read_only(directory / "a.db"); }

  /// Serves a campaign of so many runs to a worker until it ends by itself.
  void work_to_the_end(std::uint64_t num_runs, std::uint64_t session = 1001) {
    config.end = ServiceEnd::when_done;
    start({test::campaign_of("a", num_runs)});
    test::PlayingWorker worker(endpoint.address(), session);
    worker.work();
    wait_for_end();
  }
};

// Or a program that waits for the end would leave before it.
TEST_F(ServiceStop, IsNotFinishedWhileTheRuleIsChecked) {
  plan = {.stop_rule = "mean(k2c) within 5%", .num_runs_max = 100, .failures_max = {}};
  std::promise<void> begun;
  std::promise<void> released;
  files.next_runs = [&](std::uint64_t) -> std::optional<std::uint64_t> {
    begun.set_value();
    released.get_future().get();
    return std::nullopt;
  };
  start({test::campaign_of("a", 1)});
  test::PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  begun.get_future().get();
  bool is_done = true;
  CampaignPhase phase = CampaignPhase::finished;
  in_service([&] {
    is_done = service->is_done();
    phase = wire::phase_of(service->campaigns().front());
  });
  EXPECT_FALSE(is_done);
  EXPECT_EQ(phase, CampaignPhase::active);
  EXPECT_EQ(file_of_a().control().phase, CampaignPhase::active);
  released.set_value();
  (void)wait_for_event("campaign_summarised runs=1");
  in_service([&] { is_done = service->is_done(); });
  EXPECT_TRUE(is_done);
}

TEST_F(ServiceStop, ChecksARuleThatItsPredecessorDidNot) {
  work_to_the_end(1);
  service.reset();
  {
    Store store = Store::open(directory / "a.db");
    const Entry active = CampaignControl{};
    store.write({&active, 1});
  }
  plan = {.stop_rule = "mean(k2c) within 5%", .num_runs_max = 100, .failures_max = {}};
  files.next_runs = [](std::uint64_t num_runs) {
    return num_runs < 2 ? std::optional<std::uint64_t>(2) : std::nullopt;
  };
  work_to_the_end(1, 1002);
  EXPECT_EQ(num_stored("a"), 2U);
}

// Somebody else may have locked the file, or the disk may be full for a while.
TEST_F(ServiceStop, ChecksARuleAgainThatCouldNotBeChecked) {
  config.writer.retry_after = std::chrono::milliseconds(10);
  plan = {.stop_rule = "mean(k2c) within 5%", .num_runs_max = 100, .failures_max = {}};
  int num_failures = 0;
  files.next_runs = [&](std::uint64_t num_runs) {
    if (num_runs == 1 && ++num_failures <= 3) throw Error("no disk is there");
    return num_runs == 1 ? std::optional<std::uint64_t>(2) : std::nullopt;
  };
  work_to_the_end(1);
  EXPECT_EQ(wait_for_event("statistics_failed"),
            "statistics_failed reason=\"no disk is there\" campaign=a");
  EXPECT_EQ(num_events("statistics_failed"), 1);
  EXPECT_EQ(num_failures, 4);
  EXPECT_EQ(num_stored("a"), 2U);
  EXPECT_EQ(file_of_a().control().phase, CampaignPhase::finished);
}

TEST_F(ServiceStop, AsksAgainForRunsThatTheFileDidNotTake) {
  config.writer.retry_after = std::chrono::milliseconds(10);
  plan = {.stop_rule = "mean(k2c) within 5%", .num_runs_max = 100, .failures_max = {}};
  int num_failures = 0;
  files.before_extend = [&] {
    if (++num_failures <= 3) throw Error("no disk is there");
  };
  files.next_runs = [](std::uint64_t num_runs) {
    return num_runs == 1 ? std::optional<std::uint64_t>(2) : std::nullopt;
  };
  work_to_the_end(1);
  EXPECT_EQ(wait_for_event("campaign_not_extended"),
            "campaign_not_extended runs=2 reason=\"no disk is there\" campaign=a");
  EXPECT_EQ(num_events("campaign_not_extended"), 1);
  EXPECT_EQ(num_events("campaign_summarised runs=1"), 1);
  EXPECT_EQ(num_stored("a"), 2U);
}

TEST_F(ServiceStop, CountsRunsThatAreGivenUpAsFailures) {
  plan = {.stop_rule = "", .num_runs_max = {}, .failures_max = 1};
  {
    Store store = files.open(test::campaign_of("a", 5), plan, {}).store;
    const Entry given_up = GivenUpRun{.run = {4}};
    store.write({&given_up, 1});
  }
  start({test::campaign_of("a", 5)});
  test::PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow(1), RunStatus::no_draw);
  EXPECT_EQ(wait_for_event("too_many_failures"),
            "too_many_failures without_estimate=2 failures_max=1 campaign=a");
}

TEST_F(ServiceStop, DoesNotCheckARuleAgainThatItsPredecessorDid) {
  plan = {.stop_rule = "mean(k2c) within 5%", .num_runs_max = 100, .failures_max = {}};
  files.store_summary = [](Store& store) {
    CampaignStatistics statistics;
    statistics.num_runs = statistics.num_estimated = 1;
    statistics.accuracy.resize(store.schema().quantities.size());
    store.write_statistics(statistics, {}, {.results = std::string(64, 'a'), .health = ""});
  };
  start({test::campaign_of("a", 1)});
  test::PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)wait_for_event("campaign_summarised runs=1");
  end(StopRequest::now);
  start({test::campaign_of("a", 1)});
  CampaignPhase phase = CampaignPhase::active;
  in_service([&] { phase = wire::phase_of(service->campaigns().front()); });
  EXPECT_EQ(phase, CampaignPhase::finished);
  end(StopRequest::now);
  EXPECT_EQ(num_events("campaign_summarised"), 1);
}

TEST_F(ServiceStop, CountsTheFailuresOfItsPredecessor) {
  plan = {.stop_rule = "", .num_runs_max = {}, .failures_max = 1};
  start({test::campaign_of("a", 5)});
  test::PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow(1), RunStatus::no_draw);
  (void)worker.receive<proto::ResultAck>();
  end(StopRequest::now);
  start({test::campaign_of("a", 5)});
  test::PlayingWorker another(endpoint.address(), 1002);
  another.deliver(another.borrow(1), RunStatus::no_draw);
  EXPECT_EQ(wait_for_event("too_many_failures"),
            "too_many_failures without_estimate=2 failures_max=1 campaign=a");
}

}  // namespace
}  // namespace proofmass::coordinator
