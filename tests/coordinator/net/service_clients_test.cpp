// What clients ask of a service, over real sockets.

#include <gmock/gmock.h>

#include "proto/wire/client_codec.hpp"
#include "tests/coordinator/net/service_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using test::PlayingWorker;
using ::testing::ElementsAre;
using ::testing::StartsWith;
using wire::ControlAction;

/// A client's socket; every receive has a deadline.
class PlayingClient {
 public:
  explicit PlayingClient(const std::string& endpoint)
      : socket_(wire::make_dealer(context_, wire::ClientSecurity{})) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.set(zmq::sockopt::immediate, false);
    socket_.set(zmq::sockopt::rcvtimeo, 20'000);
    socket_.connect(endpoint);
  }

  wire::ReplyPacket ask_bytes(const std::vector<std::string>& frames) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const bool is_last = i + 1 == frames.size();
      (void)socket_.send(zmq::buffer(frames[i]),
                         is_last ? zmq::send_flags::none : zmq::send_flags::sndmore);
    }
    zmq::message_t frame;
    if (!socket_.recv(frame)) throw Error("no reply before the deadline");
    return std::get<wire::ReplyPacket>(wire::decode_reply(frame.to_string_view()));
  }

  wire::ClientReply ask(const wire::ClientRequest& request) {
    const wire::ReplyPacket packet =
        ask_bytes({wire::encode(wire::RequestPacket{.id = ++id_, .request = request})});
    EXPECT_EQ(packet.id, id_);
    return packet.reply;
  }

  std::string done(const wire::ClientRequest& request) {
    return std::get<wire::DoneReply>(ask(request)).text;
  }
  std::string error(const wire::ClientRequest& request) {
    return std::get<wire::ErrorReply>(ask(request)).text;
  }
  wire::StatusReply status() { return std::get<wire::StatusReply>(ask(wire::StatusRequest{})); }

 private:
  zmq::context_t context_;
  zmq::socket_t socket_;
  std::uint64_t id_ = 0;
};

class ServiceClients : public test::ServiceTest {
 protected:
  ServiceClients() { config.clients_endpoint = "tcp://127.0.0.1:*"; }

  void start_with(const std::vector<Campaign>& campaigns) {
    start(campaigns);
    client.emplace(service->clients_endpoint());
  }

  std::optional<PlayingClient> client;
};

TEST_F(ServiceClients, SubmitACampaignThatIsThenComputed) {
  start_with({});
  EXPECT_EQ(client->done(wire::SubmitRequest{
                .campaign = test::campaign_of("new", 5), .priority = 3, .audit_fraction = 0.5}),
            "campaign new: active, 5 runs, 0 of them done");
  const wire::StatusReply status = client->status();
  ASSERT_EQ(status.campaigns.size(), 1U);
  EXPECT_EQ(status.version, "0.0");
  EXPECT_EQ(status.model_version, model_version);
  EXPECT_EQ(status.campaigns[0].name, "new");
  EXPECT_EQ(status.campaigns[0].priority, 3);
  EXPECT_EQ(status.campaigns[0].num_runs, 5U);

  PlayingWorker worker(endpoint.address());
  const wire::RunLease lease = worker.borrow();
  const wire::CampaignStatus lent = client->status().campaigns[0];
  EXPECT_EQ(lent.num_lent, lease.runs.count);
  worker.deliver(lease);
  (void)worker.receive<wire::ResultAck>();
  const wire::CampaignStatus after = client->status().campaigns[0];
  EXPECT_EQ(after.num_done, lease.runs.count);
  end(StopRequest::now);
  EXPECT_EQ(num_stored("new"), lease.runs.count);
  EXPECT_EQ(Store::open_read_only(directory / "new.db").control().audit_fraction, 0.5);
}

TEST_F(ServiceClients, ExtendACampaignThatIsServed) {
  start_with({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)worker.receive<wire::ResultAck>();
  EXPECT_EQ(client->status().campaigns[0].phase, wire::CampaignPhase::finished);
  EXPECT_EQ(client->done(wire::SubmitRequest{.campaign = test::campaign_of("a", 3)}),
            "campaign a: active, 3 runs, 1 of them done");
  worker.want(1);
  EXPECT_EQ(worker.receive<wire::RunLease>().runs.first, RunIndex{1});
}

TEST_F(ServiceClients, GiveACampaignThatIsServedAnotherPriorityAndPlan) {
  start_with({test::campaign_of("a", 3)});
  (void)client->done(wire::SubmitRequest{.campaign = test::campaign_of("a", 300),
                                         .priority = -2,
                                         .audit_fraction = 0.25,
                                         .stop_rule = "mean(k2c) within 5%",
                                         .failures_max = 7});
  EXPECT_EQ(client->status().campaigns[0].priority, -2);
  EXPECT_EQ(client->status().campaigns[0].num_runs, 128U);  // The first at which rules are checked.
  end(StopRequest::now);
  const Store store = Store::open_read_only(directory / "a.db");
  EXPECT_EQ(store.control().priority, -2);
  EXPECT_EQ(store.control().audit_fraction, 0.25);
  const StopPlan expected{
      .stop_rule = "mean(k2c) within 5%", .num_runs_max = 300, .failures_max = 7};
  EXPECT_EQ(store.stop_plan(), expected);
}

TEST_F(ServiceClients, AreToldWhyACampaignCannotBeExtended) {
  start_with({test::campaign_of("a", 3)});
  EXPECT_EQ(client->error(wire::SubmitRequest{.campaign = test::campaign_of("a", 2)}),
            "runs = fewer (must be more)");
}

TEST_F(ServiceClients, CannotSubmitWhereOneCampaignIsServed) {
  config.files = nullptr;
  start_with({});
  EXPECT_EQ(client->error(wire::SubmitRequest{.campaign = test::campaign_of("a", 2)}),
            "submit = a (this coordinator serves the campaigns that it began with)");
}

TEST_F(ServiceClients, PauseAndResumeACampaign) {
  start_with({test::campaign_of("a", 3)});
  EXPECT_EQ(client->done(wire::ControlRequest{ControlAction::pause, "a"}),
            "campaign a: paused, 3 runs, 0 of them done");
  PlayingWorker worker(endpoint.address());
  (void)worker.register_here();
  EXPECT_TRUE(worker.is_lent_nothing());
  EXPECT_EQ(client->done(wire::ControlRequest{ControlAction::resume, "a"}),
            "campaign a: active, 3 runs, 0 of them done");
  worker.want(1);
  EXPECT_EQ(worker.receive<wire::RunLease>().runs.first, RunIndex{0});
}

TEST_F(ServiceClients, SeeThatACampaignWithAStopRuleIsPaused) {
  plan = {.stop_rule = "mean(k2c) within 5%", .num_runs_max = 100, .failures_max = {}};
  start_with({test::campaign_of("a", 3)});
  EXPECT_EQ(client->done(wire::ControlRequest{ControlAction::pause, "a"}),
            "campaign a: paused, 3 runs, 0 of them done");
}

// Its last runs are still under way, and count.
TEST_F(ServiceClients, LearnThatAPausedCampaignFailsTooOften) {
  plan = {.stop_rule = "", .num_runs_max = {}, .failures_max = 0};
  start_with({test::campaign_of("a", 3)});
  PlayingWorker worker(endpoint.address());
  const wire::RunLease lease = worker.borrow(1);
  (void)client->done(wire::ControlRequest{ControlAction::pause, "a"});
  worker.deliver(lease, RunStatus::no_draw);
  EXPECT_EQ(wait_for_event("too_many_failures"),
            "too_many_failures without_estimate=1 failures_max=0");
}

TEST_F(ServiceClients, GiveACampaignABudgetOfFailuresThatHoldsAtOnce) {
  start_with({test::campaign_of("a", 3)});
  (void)client->done(wire::SubmitRequest{.campaign = test::campaign_of("a", 3), .failures_max = 0});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow(1), RunStatus::no_draw);
  EXPECT_EQ(wait_for_event("too_many_failures"),
            "too_many_failures without_estimate=1 failures_max=0");
}

TEST_F(ServiceClients, SubmitACancelledCampaignAgain) {
  start_with({test::campaign_of("a", 3)});
  (void)client->done(wire::ControlRequest{ControlAction::cancel, "a"});
  EXPECT_EQ(client->done(wire::SubmitRequest{.campaign = test::campaign_of("a", 3)}),
            "campaign a: active, 3 runs, 0 of them done");
}

// The runs are there already: what is open again is whether they are enough.
TEST_F(ServiceClients, GiveAFinishedCampaignAnotherRule) {
  plan = {.stop_rule = "mean(k2c) within 5%", .num_runs_max = 1, .failures_max = {}};
  start_with({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)wait_for_event("campaign_summarised runs=1");
  const std::string reply = client->done(wire::SubmitRequest{.campaign = test::campaign_of("a", 1),
                                                             .stop_rule = "mean(k2c) within 1%"});
  EXPECT_EQ(reply, "campaign a: active, 1 runs, 1 of them done");
}

TEST_F(ServiceClients, FindACampaignPausedAfterARestart) {
  start_with({test::campaign_of("a", 3)});
  (void)client->done(wire::ControlRequest{ControlAction::pause, "a"});
  end(StopRequest::now);
  start_with({test::campaign_of("a", 3)});
  EXPECT_EQ(client->status().campaigns[0].phase, wire::CampaignPhase::paused);
}

TEST_F(ServiceClients, CancelACampaignWhichWorkersThenForget) {
  start_with({test::campaign_of("a", 3)});
  PlayingWorker worker(endpoint.address());
  const wire::RunLease lease = worker.borrow();
  EXPECT_EQ(client->done(wire::ControlRequest{ControlAction::cancel, "a"}),
            "campaign a: cancelled, 3 runs, 0 of them done");
  EXPECT_EQ(worker.receive<wire::Forget>().campaign, lease.campaign);
  EXPECT_EQ(client->status().campaigns[0].phase, wire::CampaignPhase::cancelled);
}

TEST_F(ServiceClients, AreToldWhatCannotBeControlled) {
  start_with({test::campaign_of("a", 1)});
  EXPECT_EQ(client->error(wire::ControlRequest{ControlAction::pause, "b"}),
            "campaign = b (is not served)");
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)worker.receive<wire::ResultAck>();
  EXPECT_EQ(client->error(wire::ControlRequest{ControlAction::pause, "a"}),
            "campaign = a (is finished)");
}

TEST_F(ServiceClients, SeeTheWorkers) {
  start_with({test::campaign_of("a", 30)});
  PlayingWorker worker(endpoint.address());
  const wire::RunLease lease = worker.borrow();
  const auto reply = std::get<wire::WorkersReply>(client->ask(wire::WorkersRequest{}));
  ASSERT_EQ(reply.workers.size(), 1U);
  EXPECT_EQ(reply.workers[0].name, "w1001");
  EXPECT_EQ(reply.workers[0].host, "here");
  EXPECT_EQ(reply.workers[0].process_id, 1001U);
  EXPECT_EQ(reply.workers[0].num_slots, 1U);
  EXPECT_EQ(reply.workers[0].num_lent, lease.runs.count);
  EXPECT_FALSE(reply.workers[0].is_quarantined);
}

TEST_F(ServiceClients, GetAnErrorForWhatIsNoRequest) {
  start_with({});
  const wire::ReplyPacket garbage = client->ask_bytes({"garbage"});
  EXPECT_EQ(garbage.id, 0U);
  EXPECT_TRUE(std::holds_alternative<wire::ErrorReply>(garbage.reply));
  EXPECT_EQ(std::get<wire::ErrorReply>(client->ask_bytes({"a", "b"}).reply).text,
            "request = 2 frames (must be one)");
}

TEST_F(ServiceClients, FindTheStatisticsOfAFinishedCampaignUpToDate) {
  start_with({test::campaign_of("a", 1)});
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)worker.receive<wire::ResultAck>();
  (void)wait_for_event("campaign_summarised");
  end(StopRequest::now);
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
  (void)worker.receive<wire::ResultAck>();
  (void)wait_for_event("campaign_summarised");
  (void)client->done(wire::SubmitRequest{.campaign = test::campaign_of("a", 1), .priority = 5});
  end(StopRequest::now);
  EXPECT_EQ(Store::open_read_only(directory / "a.db").control().priority, 5);
  EXPECT_EQ(num_summaries, 1);
}

TEST_F(ServiceClients, AreToldTheEndByAServiceThatEndsWhenAllIsDone) {
  config.end = ServiceEnd::when_done;
  start_with({test::campaign_of("a", 1)});
  EXPECT_EQ(client->status().campaigns[0].phase, wire::CampaignPhase::active);
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)worker.receive<wire::ResultAck>();
  (void)wait_for_event("campaign_summarised");
  EXPECT_EQ(client->status().campaigns[0].phase, wire::CampaignPhase::finished);
  wait_for_end();
}

}  // namespace
}  // namespace proofmass::coordinator
