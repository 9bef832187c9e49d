// What clients ask of a service, over real sockets.

#include <gmock/gmock.h>

#include <atomic>

#include "core/microscope/definition/campaign_definition.hpp"
#include "proto/wire/client_codec.hpp"
#include "tests/coordinator/net/playing_client.hpp"
#include "tests/coordinator/net/service_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using proto::ControlAction;
using test::PlayingClient;
using test::PlayingWorker;
using ::testing::ElementsAre;
using ::testing::StartsWith;

class ServiceClients : public test::ServiceTest {
 protected:
  ServiceClients() { config.clients_endpoint = "tcp://127.0.0.1:*"; }

  void start_with(const std::vector<MicroscopeCampaign>& campaigns) {
    start(campaigns);
    client.emplace(service->clients_endpoint());
  }

  /// The coordinator's words.
  std::string submit(const std::string& name, std::uint64_t num_runs,
                     const test::Wishes& wishes = {}) {
    return client->done(test::submission(definition_of(test::campaign_of(name, num_runs)), wishes));
  }
  std::string control(ControlAction action, const std::string& name = "a", int priority = 0) {
    return client->done(test::control(action, name, priority));
  }

  std::optional<PlayingClient> client;
};

TEST_F(ServiceClients, GiveACampaignThatIsServedAnotherPriorityAndPlan) {
  start_with({test::campaign_of("a", 3)});
  (void)submit("a", 300,
               {.priority = -2,
                .audit_fraction = 0.25,
                .stop_rule = "mean(k2c) within 5%",
                .failures_max = 7});
  EXPECT_EQ(client->status().campaigns(0).priority(), -2);
  EXPECT_EQ(client->status().campaigns(0).num_runs(),
            128U);  // The first at which rules are checked.
  end(StopRequest::now);
  const Store store = Store::open_read_only(directory / "a.db");
  EXPECT_EQ(store.control().priority, -2);
  EXPECT_EQ(store.control().audit_fraction, 0.25);
  const StopPlan expected{
      .stop_rule = "mean(k2c) within 5%", .num_runs_max = 300, .failures_max = 7};
  EXPECT_EQ(store.stop_plan(), expected);
}

TEST_F(ServiceClients, RetryTheRunsThatWereGivenUp) {
  {
    ServedCampaign campaign = files.open(test::campaign_of("a", 1), {}, {});
    const Entry given_up = GivenUpRun{.run = {0}};
    (void)campaign.store.write({&given_up, 1});
  }
  start_with({test::campaign_of("a", 1)});
  EXPECT_EQ(client->error(test::control(proto::CONTROL_ACTION_SET_PRIORITY, "a", 1)),
            "campaign = a (is finished)");
  EXPECT_EQ(control(proto::CONTROL_ACTION_RETRY), "campaign a: active, 1 runs, 0 of them done");
  EXPECT_EQ(client->error(test::control(proto::CONTROL_ACTION_RETRY, "a")),
            "campaign = a (has no run that was given up)");
  EXPECT_EQ(client->status().campaigns(0).num_given_up(), 0U);
  end(StopRequest::now);
  EXPECT_THAT(Store::open_read_only(directory / "a.db").given_up_runs(), ElementsAre());
}

TEST_F(ServiceClients, ResumeACancelledCampaignBeforeAnythingElse) {
  start_with({test::campaign_of("a", 1)});
  (void)control(proto::CONTROL_ACTION_CANCEL);
  for (const ControlAction action : {proto::CONTROL_ACTION_RETRY, proto::CONTROL_ACTION_PAUSE,
                                     proto::CONTROL_ACTION_SET_PRIORITY}) {
    EXPECT_EQ(client->error(test::control(action, "a", 1)),
              "campaign = a (is cancelled; resume it first)");
  }
}

TEST_F(ServiceClients, CannotSubmitWhereOneCampaignIsServed) {
  config.files = nullptr;
  start_with({});
  EXPECT_EQ(
      client->error(test::submission(definition_of(test::campaign_of("a", 2)))),
      "campaign a cannot be submitted: this coordinator serves only the campaigns that it began "
      "with; "
      "start one with --directory");
}

// Its last runs are still under way, and count.
TEST_F(ServiceClients, LearnThatAPausedCampaignFailsTooOften) {
  plan = {.stop_rule = "", .num_runs_max = {}, .failures_max = 0};
  start_with({test::campaign_of("a", 3)});
  PlayingWorker worker(endpoint.address());
  const proto::RunLease lease = worker.borrow(1);
  (void)control(proto::CONTROL_ACTION_PAUSE);
  worker.deliver(lease, RunStatus::no_draw);
  EXPECT_EQ(wait_for_event("too_many_failures"),
            "too_many_failures without_estimate=1 failures_max=0 campaign=a");
}

TEST_F(ServiceClients, GiveACampaignABudgetOfFailuresThatHoldsAtOnce) {
  start_with({test::campaign_of("a", 3)});
  (void)submit("a", 3, {.failures_max = 0});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow(1), RunStatus::no_draw);
  EXPECT_EQ(wait_for_event("too_many_failures"),
            "too_many_failures without_estimate=1 failures_max=0 campaign=a");
}

TEST_F(ServiceClients, HearOfAllRunsWithoutAnEstimateAfterARestart) {
  start_with({test::campaign_of("a", 3)});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow(1), RunStatus::no_draw);
  (void)worker.receive<proto::ResultAck>();
  end(StopRequest::now);
  start_with({test::campaign_of("a", 3)});
  worker.deliver(worker.borrow(1), RunStatus::no_draw);
  (void)worker.receive<proto::ResultAck>();
  EXPECT_EQ(client->status().campaigns(0).num_without_estimate(), 2U);
}

// The runs are there already: what is open again is whether they are enough.
TEST_F(ServiceClients, GiveAFinishedCampaignAnotherRule) {
  plan = {.stop_rule = "mean(k2c) within 5%", .num_runs_max = 1, .failures_max = {}};
  start_with({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)wait_for_event("campaign_summarised runs=1");
  const std::string reply = submit("a", 1, {.stop_rule = "mean(k2c) within 1%"});
  EXPECT_EQ(reply, "campaign a: active, 1 runs, 1 of them done");
}

/// A submission of so many runs with a table, as bytes.
std::string large_submission(std::uint64_t id, const std::string& name, std::size_t num_runs) {
  MicroscopeCampaign campaign = test::campaign_of(name, num_runs);
  campaign.dispersions[5] = {.law = Law::table, .file = "f.csv", .column = "a"};
  campaign.table_columns = {std::vector<double>(num_runs, 1e-3)};
  return wire::encode(test::numbered(id, test::submission(definition_of(campaign))));
}

proto::RequestEnvelope part_of(const std::string& bytes, std::size_t offset) {
  return test::request_of(
      test::part(bytes.size(), offset, bytes.substr(offset, wire::request_part_size_max)));
}

TEST_F(ServiceClients, GetOneCampaignForASubmissionThatTheyRepeat) {
  start_with({});
  PlayingClient other(service->clients_endpoint());
  const std::string bytes = large_submission(7, "mine", 100'000);
  for (PlayingClient* const asker : {&*client, &other}) {
    for (std::size_t offset = 0; offset < bytes.size(); offset += wire::request_part_size_max) {
      asker->send(7, part_of(bytes, offset));
      (void)asker->receive_final();
    }
  }
  for (PlayingClient* const asker : {&*client, &other}) {
    EXPECT_EQ(asker->receive_final().done().text(),
              "campaign mine: active, 100000 runs, 0 of them done");
  }
}

TEST_F(ServiceClients, AreToldThatALargeRequestMustTravelInParts) {
  start_with({});
  const std::string bytes = large_submission(7, "mine", 100'000);
  EXPECT_EQ(client->ask_bytes({bytes}).error().text(),
            "request size = " + std::to_string(bytes.size()) +
                " bytes (must be at most 263168 in one message; larger ones travel in parts)");
}

TEST_F(ServiceClients, GetAnErrorForPartsThatAreNoRequest) {
  start_with({});
  client->send(7, test::request_of(test::part(3, 0, "abc")));
  EXPECT_EQ(client->receive().part().next_offset(), 3U);
  const proto::ReplyEnvelope refused = client->receive_final();
  EXPECT_EQ(refused.request_id(), 7U);
  EXPECT_EQ(refused.error().text(),
            "request = 3 bytes (must be an envelope of at most 65536 fields)");
}

// What a caller's code throws, other than our own errors, ends the request and not the service.
TEST_F(ServiceClients, OutliveAFileSystemThatThrows) {
  std::atomic<int> num_calls = 0;
  files.before_open = [&num_calls] {
    const int call = num_calls++;
    if (call == 0) throw std::filesystem::filesystem_error("rename", std::error_code());
    if (call == 1) throw std::bad_alloc();
  };
  start_with({});
  const proto::RequestEnvelope request = test::submission(definition_of(test::campaign_of("a", 2)));
  EXPECT_THAT(client->error(request), StartsWith("filesystem error: rename"));
  EXPECT_EQ(client->error(request), "std::bad_alloc");
  EXPECT_THAT(client->done(request), StartsWith("campaign a: active"));
}

// The file is a copy of one that is served, and stays.
TEST_F(ServiceClients, AreToldThatAFileCannotBeServed) {
  std::atomic<int> num_calls = 0;
  files.before_open = [&] {
    if (num_calls++ == 1) std::filesystem::copy_file(directory / "b.db", directory / "a.db");
  };
  start_with({test::campaign_of("b", 2)});
  const proto::RequestEnvelope request = test::submission(definition_of(test::campaign_of("a", 2)));
  const std::string expected = "campaign = a in " + (directory / "a.db").string() +
                               " (is served already, from another file)";
  EXPECT_EQ(client->error(request), expected);
  EXPECT_EQ(client->error(request), expected);
  EXPECT_TRUE(std::filesystem::exists(directory / "a.db"));
  end(StopRequest::now);
}

// The campaign has failed by the new limit, and nobody can be told of it.
TEST_F(ServiceClients, AreToldWhatFailsWhenTheirChangeTakesEffect) {
  config.on_notice = [](const CampaignNotice&) { throw Error("notice = a (must be heard)"); };
  start_with({test::campaign_of("a", 3)});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow(1), RunStatus::no_draw);
  (void)worker.receive<proto::ResultAck>();
  EXPECT_EQ(client->error(
                test::submission(definition_of(test::campaign_of("a", 3)), {.failures_max = 0})),
            "notice = a (must be heard)");
}

TEST_F(ServiceClients, SeeAllCampaignsInPages) {
  std::vector<MicroscopeCampaign> campaigns;
  for (std::size_t i = 0; i < 3; ++i) {
    campaigns.push_back(test::campaign_of("c" + std::to_string(i), 1));
  }
  start_with(campaigns);
  const proto::StatusReply page = client->status(1);
  EXPECT_EQ(page.num_campaigns(), 3U);
  ASSERT_EQ(page.campaigns_size(), 2);
  EXPECT_EQ(page.campaigns(0).name(), "c1");
  EXPECT_TRUE(client->status(~std::uint64_t{0}).campaigns().empty());
}

TEST_F(ServiceClients, GetAnErrorForWhatIsNoRequest) {
  start_with({});
  const proto::ReplyEnvelope garbage = client->ask_bytes({"garbage"});
  EXPECT_EQ(garbage.request_id(), 0U);
  EXPECT_TRUE(garbage.has_error());
  EXPECT_EQ(client->ask_bytes({"a", "b"}).error().text(), "request = 2 frames (must be one)");
}

TEST_F(ServiceClients, HaveStatisticsMadeForNewResultsOnly) {
  std::atomic<int> num_summaries = 0;
  files.next_runs = [&](std::uint64_t) -> std::optional<std::uint64_t> {
    ++num_summaries;
    return std::nullopt;
  };
  start_with({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)worker.receive<proto::ResultAck>();
  (void)wait_for_event("campaign_summarised");
  (void)submit("a", 1, {.priority = 5});
  end(StopRequest::now);
  EXPECT_EQ(Store::open_read_only(directory / "a.db").control().priority, 5);
  EXPECT_EQ(num_summaries, 1);
}

proto::RequestEnvelope fetching(const std::string& campaign) {
  proto::RequestEnvelope request;
  request.mutable_answer()->set_campaign(campaign);
  request.mutable_answer()->set_question(proto::QUESTION_DATABASE);
  return request;
}

// The answer itself is an error: there is no program that makes a copy.
TEST_F(ServiceClients, WaitWithACopyForTheStatistics) {
  std::promise<void> begun;
  std::promise<void> released;
  files.before_summary = [&] {
    begun.set_value();
    released.get_future().get();
  };
  start_with({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  begun.get_future().get();
  client->send(100, fetching("a"));
  EXPECT_EQ(client->status().campaigns(0).phase(), proto::CAMPAIGN_PHASE_FINISHED);
  released.set_value();
  const proto::ReplyEnvelope reply = client->receive_final();
  EXPECT_EQ(reply.request_id(), 100U);
  EXPECT_THAT(reply.error().text(), StartsWith("this coordinator cannot answer questions"));
  EXPECT_EQ(num_events("campaign_summarised"), 1);
}

TEST_F(ServiceClients, DoNotWaitWithACopyForStatisticsThatFail) {
  files.before_summary = [] { throw Error("the disk is full"); };
  start_with({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)wait_for_event("statistics_failed");
  EXPECT_THAT(client->error(fetching("a")), StartsWith("this coordinator cannot answer questions"));
}

/// One result, a cancelled campaign's statistics of it, and another result after that.
class CancelledClients : public ServiceClients {
 protected:
  void deliver_around_a_cancel(PlayingWorker& worker) {
    worker.deliver(worker.borrow());
    (void)worker.receive<proto::ResultAck>();
    (void)control(proto::CONTROL_ACTION_CANCEL);
    (void)wait_for_event("campaign_summarised runs=1");
    (void)control(proto::CONTROL_ACTION_RESUME);
    worker.want(1);
    worker.deliver(worker.receive<proto::RunLease>());
  }
};

TEST_F(CancelledClients, HaveStatisticsMadeEachTimeTheyCancel) {
  start_with({test::campaign_of("a", 3)});
  PlayingWorker worker(endpoint.address());
  deliver_around_a_cancel(worker);
  (void)worker.receive<proto::ResultAck>();
  (void)control(proto::CONTROL_ACTION_CANCEL);
  (void)wait_for_event("campaign_summarised runs=2");
}

// The statistics that were made in between say nothing of the rule.
TEST_F(CancelledClients, WaitForTheRuleOfACampaignThatTheyCancelledBefore) {
  plan = {.stop_rule = "mean(k2c) within 5%", .num_runs_max = 2, .failures_max = {}};
  std::promise<void> begun;
  std::promise<void> released;
  std::atomic<int> num_summaries = 0;
  files.next_runs = [&](std::uint64_t) -> std::optional<std::uint64_t> {
    if (num_summaries++ == 0) return std::nullopt;
    begun.set_value();
    released.get_future().get();
    return std::nullopt;
  };
  start_with({test::campaign_of("a", 2)});
  PlayingWorker worker(endpoint.address());
  deliver_around_a_cancel(worker);
  begun.get_future().get();
  EXPECT_EQ(client->status().campaigns(0).phase(), proto::CAMPAIGN_PHASE_ACTIVE);
  released.set_value();
  (void)wait_for_event("campaign_summarised runs=2");
}

}  // namespace
}  // namespace proofmass::coordinator
