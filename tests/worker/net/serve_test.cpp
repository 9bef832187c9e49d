#include "worker/net/serve.hpp"

#include <poll.h>
#include <pthread.h>
#include <signal.h>

#include <zmq.hpp>

#include "core/error.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "proto/wire/codec.hpp"
#include "proto/wire/definition_codec.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/support/messages.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/prepared_campaign.hpp"
#include "tests/test.hpp"
#include "worker/execution/executor.hpp"
#include "worker/net/held_runs.hpp"
#include "worker/supervision/supervisor.hpp"

namespace proofmass::worker {
namespace {

constexpr wire::SessionId session{99};
constexpr wire::Epoch epoch{3};
constexpr wire::CampaignId campaign{1};
constexpr int patience_ms = 60'000;

/// A coordinator of a few lines: it sends what the test says and hands out what comes.
class Coordinator {
 public:
  explicit Coordinator(const std::string& endpoint) : socket_(context_, zmq::socket_type::router) {
    socket_.set(zmq::sockopt::rcvtimeo, patience_ms);
    socket_.bind(endpoint);
  }

  /// The next message of this kind; others are passed over.
  template <typename Content>
  Content receive() {
    while (true) {
      zmq::message_t peer;
      zmq::message_t frame;
      if (!socket_.recv(peer) || !socket_.recv(frame)) throw std::runtime_error("nothing came");
      peer_ = peer.to_string();
      const auto decoded = wire::decode(frame.to_string_view());
      const auto& envelope = std::get<proto::Envelope>(decoded);
      EXPECT_EQ(envelope.session(), session.value);
      if (test::holds<Content>(envelope)) return test::content_of<Content>(envelope);
    }
  }
  template <typename Content>
  void send(const Content& content) {
    proto::Envelope envelope = test::in_envelope(content);
    envelope.set_session(session.value);
    envelope.set_epoch(epoch.value);
    envelope.set_sequence(++num_sent_);
    send_bytes(wire::encode(envelope));
  }
  /// The connection on which the last message came.
  [[nodiscard]] const std::string& peer() const { return peer_; }
  void send_bytes(const std::string& bytes) {
    socket_.send(zmq::buffer(peer_), zmq::send_flags::sndmore);
    socket_.send(zmq::buffer(bytes));
  }
  /// The worker registers, asks for the campaign and delivers the first two runs.
  proto::ResultBatch have_two_runs_computed() {
    (void)receive<proto::Hello>();
    send(test::make_welcome({1}, 1.0));
    (void)receive<proto::Heartbeat>();
    send(test::make_lease(campaign, {{0}, 2}, {1}));
    (void)receive<proto::CampaignRequest>();
    send(wire::EncodedDefinition(definition_of(MicroscopeCampaign{})).part(campaign, 0));
    return receive<proto::ResultBatch>();
  }

 private:
  zmq::context_t context_;
  zmq::socket_t socket_;
  std::string peer_;
  std::uint64_t num_sent_ = 0;
};

test::PreparedCampaign prepare(const Campaign&) {
  return {.simulate =
              [](std::span<const RunRequest> requests, const std::function<void(int)>& progress) {
                progress(1);
                std::vector<RunResult> results;
                for (const RunRequest& request : requests) {
                  results.push_back(test::zero_result({.run = request.run}));
                }
                return results;
              },
          .num_steps = 1};
}

class ServeTest : public testing::Test {
 protected:
  ServeTest() {
    config.endpoint = "ipc://" + (directory / "socket").string();
    config.session = session;
    config.hello = test::make_hello("w", "h", 1, "m");
  }

  /// Serves in a thread of its own.
  std::future<Ending> start_worker() {
    return std::async(std::launch::async, [this] {
      StopSignals signals(config.signals);
      const wire::Wake progress;
      Executor executor(prepare, [&] { progress.notify(); },
                        {.num_threads = 1, .batch_size_max = 2});
      return serve(config, executor, progress, signals);
    });
  }

  test::ScratchDirectory directory;
  ServeConfig config;
};

TEST_F(ServeTest, IsNotDisturbedByRubbish) {
  Coordinator coordinator(config.endpoint);
  std::future<Ending> ending = start_worker();
  (void)coordinator.receive<proto::Hello>();
  coordinator.send_bytes("rubbish");
  coordinator.send(proto::Stop());  // Of no coordinator that the worker has registered with.
  coordinator.send(test::make_reject(proto::REJECT_REASON_INCOMPATIBLE, "enough"));
  EXPECT_EQ(ending.get().reason, "refused by the coordinator: enough");
}

// The coordinator listens no more to a connection on which something broke the rules.
TEST_F(ServeTest, ComesAgainOnAnotherConnectionIfItIsClosedOut) {
  config.conversation.refusal_delay = std::chrono::milliseconds(50);
  Coordinator coordinator(config.endpoint);
  std::future<Ending> ending = start_worker();
  (void)coordinator.have_two_runs_computed();
  const std::string first_connection = coordinator.peer();
  coordinator.send(test::make_reject(proto::REJECT_REASON_MALFORMED, "bad"));
  (void)coordinator.receive<proto::Hello>();
  EXPECT_NE(coordinator.peer(), first_connection);
  coordinator.send(test::make_welcome({1}, 1.0));
  EXPECT_EQ(coordinator.receive<proto::ResultBatch>().results_size(), 2);
  coordinator.send(proto::Stop());
  EXPECT_EQ(ending.get().reason, "told to stop");
}

TEST_F(ServeTest, WarnsOfAnAddressAtWhichNobodyAnswers) {
  std::vector<std::string> events;
  config.log = [&](const wire::Event& event) { events.push_back(wire::to_text(event)); };
  config.conversation.give_up_after = std::chrono::seconds(1);
  EXPECT_EQ(start_worker().get().kind, Ending::Kind::failed);
  EXPECT_EQ(events.front(),
            "coordinator_silent connect=" + config.endpoint + " silent_s=0 (tries again)");
  events.clear();
  config.endpoint = "tcp://coordinator.invalid:5555";
  EXPECT_EQ(start_worker().get().kind, Ending::Kind::failed);
  EXPECT_THAT(events.front(), testing::StartsWith("coordinator_unknown connect=" + config.endpoint +
                                                  " reason=\"host coordinator.invalid: "));
}

TEST_F(ServeTest, SaysWhyTheSpoolCannotBeUsed) {
  config.spool = directory / "missing" / "spool";
  std::future<Ending> ending = start_worker();
  try {
    (void)ending.get();
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()),
              "spool = " + config.spool->string() + " (No such file or directory)");
  }
}

TEST(HeldRuns, AreGroupedByCampaignAndAttempt) {
  const std::vector<HeldRun> runs{{{2}, {1}, {5}}, {{1}, {2}, {7}}, {{1}, {1}, {8}},
                                  {{1}, {1}, {6}}, {{1}, {1}, {7}}, {{1}, {1}, {3}}};
  const std::vector expected{test::make_held({1}, {1}, {{{3}, 1}, {{6}, 3}}),
                             test::make_held({1}, {2}, {{{7}, 1}}),
                             test::make_held({2}, {1}, {{{5}, 1}})};
  EXPECT_EQ(test::vector_of(grouped(runs, 10)), expected);
  EXPECT_TRUE(grouped({}, 10).empty());
}

TEST(HeldRuns, AreCutToTheRangesThatAMessageMayHave) {
  const std::vector<HeldRun> runs{
      {{1}, {1}, {0}}, {{1}, {1}, {1}}, {{1}, {1}, {5}}, {{1}, {2}, {7}}, {{1}, {2}, {8}}};
  std::vector expected{test::make_held({1}, {1}, {{{0}, 2}, {{5}, 1}})};
  EXPECT_EQ(test::vector_of(grouped(runs, 2)), expected);
  expected.push_back(test::make_held({1}, {2}, {{{7}, 2}}));
  EXPECT_EQ(test::vector_of(grouped(runs, 3)), expected);
}

bool is_readable(const StopSignals& signals) {
  pollfd item{.fd = signals.descriptor(), .events = POLLIN, .revents = 0};
  return poll(&item, 1, 0) == 1;
}

/// As the supervisor does.
void hand_on(int num_requests) {
  pthread_sigqueue(pthread_self(), handed_on_signal(), {.sival_int = num_requests});
}

TEST(StopSignals, DrainAtFirstAndEndAtOnceThen) {
  StopSignals signals(SignalSource::anyone);
  EXPECT_EQ(signals.request(), EndRequest::none);
  EXPECT_FALSE(is_readable(signals));
  raise(SIGTERM);
  EXPECT_TRUE(is_readable(signals));
  EXPECT_EQ(signals.request(), EndRequest::drain);
  EXPECT_FALSE(is_readable(signals));
  EXPECT_EQ(signals.request(), EndRequest::drain);
  raise(SIGINT);
  EXPECT_EQ(signals.request(), EndRequest::abandon);
}

// SIGTERM to both processes, once or twice, is one request as long as the supervisor has one.
TEST(StopSignals, AreCountedByTheSupervisor) {
  StopSignals signals(SignalSource::supervisor);
  raise(SIGTERM);
  EXPECT_EQ(signals.request(), EndRequest::drain);
  hand_on(1);
  EXPECT_EQ(signals.request(), EndRequest::drain);
  raise(SIGINT);
  EXPECT_EQ(signals.request(), EndRequest::drain);
  hand_on(2);
  EXPECT_EQ(signals.request(), EndRequest::abandon);
  raise(SIGTERM);
  EXPECT_EQ(signals.request(), EndRequest::abandon);
}

TEST(StopSignals, EndAtOnceIfTheyComeFromTheCampaign) {
  StopSignals signals(SignalSource::campaign);
  raise(SIGINT);
  EXPECT_EQ(signals.request(), EndRequest::none);
  raise(SIGTERM);
  EXPECT_EQ(signals.request(), EndRequest::abandon);
}

}  // namespace
}  // namespace proofmass::worker
