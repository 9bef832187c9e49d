#include "worker/net/serve.hpp"

#include <gtest/gtest.h>
#include <pthread.h>
#include <signal.h>

#include <future>
#include <thread>
#include <zmq.hpp>

#include "core/error.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "proto/wire/codec.hpp"
#include "proto/wire/definition_codec.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/support/faults/planned_faults.hpp"
#include "tests/support/messages.hpp"
#include "tests/support/microscope_results.hpp"
#include "worker/execution/executor.hpp"
#include "worker/spool/spool.hpp"

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

PreparedCampaign prepare(const Campaign&) {
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

  /// Serves in a thread of its own, which gets its signals.
  std::future<Ending> start_worker() {
    std::promise<pthread_t> thread;
    worker_thread = thread.get_future();
    return std::async(std::launch::async, [this, promise = std::move(thread)]() mutable {
      StopSignals signals(config.signals);
      promise.set_value(pthread_self());
      const wire::Wake progress;
      Executor executor(prepare, [&] { progress.notify(); },
                        {.num_threads = 1, .batch_size_max = 2});
      return serve(config, executor, progress, signals);
    });
  }

  test::ScratchDirectory directory;
  ServeConfig config;
  std::future<pthread_t> worker_thread;
};

TEST_F(ServeTest, ComputesForACoordinatorUntilItIsDrained) {
  Coordinator coordinator(config.endpoint);
  std::future<Ending> ending = start_worker();
  EXPECT_EQ(coordinator.have_two_runs_computed().results_size(), 2);
  coordinator.send(test::make_ack(campaign, {{0}, {1}}));
  coordinator.send(proto::Drain());
  EXPECT_EQ(coordinator.receive<proto::Bye>().reason(), proto::LOSS_REASON_DRAINED);
  const Ending end = ending.get();
  EXPECT_EQ(end.kind, Ending::Kind::done);
  EXPECT_EQ(end.reason, "drained");
}

TEST_F(ServeTest, DrainsAtASignal) {
  Coordinator coordinator(config.endpoint);
  std::future<Ending> ending = start_worker();
  (void)coordinator.have_two_runs_computed();
  pthread_kill(worker_thread.get(), SIGTERM);
  EXPECT_EQ(coordinator.receive<proto::Heartbeat>().held().size(), 1U) << "not acknowledged yet";
  coordinator.send(test::make_ack(campaign, {{0}, {1}}));
  EXPECT_EQ(coordinator.receive<proto::Bye>().reason(), proto::LOSS_REASON_PREEMPTED);
  EXPECT_EQ(ending.get().reason, "nothing left to do");
}

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

// 160 results of a campaign that was not served for a moment were once deleted without a word.
TEST_F(ServeTest, KeepsItsSpoolWhileACampaignIsNotServed) {
  config.spool = directory / "spool";
  Coordinator coordinator(config.endpoint);
  std::future<Ending> first = start_worker();
  (void)coordinator.have_two_runs_computed();
  coordinator.send(proto::Stop());
  EXPECT_EQ(first.get().reason, "told to stop");

  std::future<Ending> second = start_worker();
  (void)coordinator.receive<proto::Hello>();
  coordinator.send(test::make_welcome({2}, 0.05));
  EXPECT_EQ(coordinator.receive<proto::ResultBatch>().results_size(), 2);
  coordinator.send(test::make_not_served(campaign));
  while (coordinator.receive<proto::Heartbeat>().set_aside().empty()) {
  }
  coordinator.send(proto::Stop());
  EXPECT_EQ(second.get().reason, "told to stop");
  EXPECT_EQ(Spool(*config.spool, "m").former_results().size(), 2U);

  std::future<Ending> third = start_worker();
  (void)coordinator.receive<proto::Hello>();
  coordinator.send(test::make_welcome({3}, 1.0));
  EXPECT_EQ(coordinator.receive<proto::ResultBatch>().results_size(), 2);
  coordinator.send(test::make_forget(campaign, 2));
  coordinator.send(proto::Drain());
  EXPECT_EQ(third.get().reason, "drained");
  EXPECT_FALSE(std::filesystem::exists(*config.spool));
}

TEST_F(ServeTest, KeepsResultsForTheNextWorkerInItsSpool) {
  config.spool = directory / "spool";
  Coordinator coordinator(config.endpoint);
  std::future<Ending> first = start_worker();
  (void)coordinator.have_two_runs_computed();
  coordinator.send(test::make_ack(campaign, {{0}}));
  coordinator.send(proto::Stop());
  EXPECT_EQ(first.get().reason, "told to stop");
  EXPECT_TRUE(std::filesystem::exists(*config.spool));

  std::future<Ending> second = start_worker();
  (void)coordinator.receive<proto::Hello>();
  coordinator.send(test::make_welcome({2}, 1.0));
  const auto batch = coordinator.receive<proto::ResultBatch>();
  ASSERT_EQ(batch.results_size(), 1);
  EXPECT_EQ(batch.results(0).run(), 1U);
  coordinator.send(test::make_ack(campaign, {{1}}));
  coordinator.send(proto::Drain());
  EXPECT_EQ(second.get().reason, "drained");
  EXPECT_FALSE(std::filesystem::exists(*config.spool));
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

// Every other message is lost, both ways.
TEST_F(ServeTest, DeliversAlthoughMessagesAreLost) {
  wire::plan_faults(wire::FaultPlan::parse("seed=1,drop=0.5"));
  config.conversation.resend_after = std::chrono::milliseconds(50);
  Coordinator coordinator(config.endpoint);
  std::future<Ending> ending = start_worker();
  (void)coordinator.receive<proto::Hello>();
  for (int i = 0; i < 20; ++i) {
    coordinator.send(test::make_welcome({1}, 0.01));
  }
  (void)coordinator.receive<proto::Heartbeat>();
  for (int i = 0; i < 20; ++i) {
    coordinator.send(test::make_lease(campaign, {{0}, 1}, {1}));
  }
  (void)coordinator.receive<proto::CampaignRequest>();
  for (int i = 0; i < 20; ++i) {
    coordinator.send(
        wire::EncodedDefinition(definition_of(MicroscopeCampaign{})).part(campaign, 0));
  }
  EXPECT_EQ(coordinator.receive<proto::ResultBatch>().results_size(), 1);
  for (int i = 0; i < 20; ++i) coordinator.send(proto::Stop());
  EXPECT_EQ(ending.get().reason, "told to stop");
  wire::plan_faults({});
}

}  // namespace
}  // namespace proofmass::worker
