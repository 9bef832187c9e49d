// The service over real sockets, with workers that the test plays itself.

#include "coordinator/net/campaign_service.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <set>
#include <thread>
#include <zmq.hpp>

#include "coordinator/net/private_endpoint.hpp"
#include "core/error.hpp"
#include "core/simulation/run.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::coordinator {
namespace {

/// A worker's socket; every receive has a deadline, so that a failing test ends.
class Peer {
 public:
  explicit Peer(const std::string& endpoint) : socket_(context_, zmq::socket_type::dealer) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.set(zmq::sockopt::rcvtimeo, 10'000);
    socket_.connect(endpoint);
  }

  void send_bytes(const std::string& bytes) {
    (void)socket_.send(zmq::buffer(bytes), zmq::send_flags::none);
  }
  void send_two_frames() {
    (void)socket_.send(zmq::str_buffer("a"), zmq::send_flags::sndmore);
    send_bytes("b");
  }
  void send(const wire::Message& message) { send_bytes(wire::encode(message)); }

  /// The next message of this kind; others are passed over.
  template <typename Content>
  Content receive() {
    while (true) {
      zmq::message_t frame;
      if (!socket_.recv(frame)) throw Error("no message before the deadline");
      auto decoded = wire::decode(frame.to_string_view());
      auto& message = std::get<wire::Message>(decoded);
      if (auto* const content = std::get_if<Content>(&message)) return *content;
    }
  }

  void say_hello(std::uint64_t process_id = 77) {
    send(wire::Hello{.worker_name = "peer",
                     .host = "here",
                     .process_id = process_id,
                     .num_slots = 1,
                     .model_version = std::string(model_version)});
  }

  wire::RunLease borrow() {
    say_hello();
    (void)receive<wire::Welcome>();
    send(wire::Credit{.num_runs_max = 4096});
    return receive<wire::RunLease>();
  }

  void deliver(const wire::RunLease& lease) {
    wire::ResultBatch batch{.lease = lease.lease, .attempt = lease.attempt, .results = {}};
    for (std::uint64_t run = lease.runs.first.value; run < lease.runs.end(); ++run) {
      batch.results.emplace_back().result.run = {run};
    }
    send(batch);
  }

  /// Computes until told to stop.
  void work() {
    deliver(borrow());
    while (true) {
      zmq::message_t frame;
      if (!socket_.recv(frame)) throw Error("no message before the deadline");
      auto decoded = wire::decode(frame.to_string_view());
      auto& message = std::get<wire::Message>(decoded);
      if (std::holds_alternative<wire::Stop>(message)) return;
      if (auto* const lease = std::get_if<wire::RunLease>(&message)) deliver(*lease);
    }
  }

 private:
  zmq::context_t context_;
  zmq::socket_t socket_;
};

class CampaignServiceTest : public testing::Test {
 protected:
  std::unique_ptr<CampaignService> make_service(std::uint64_t num_runs, const std::string& address,
                                                const std::vector<RunRange>& finished = {}) {
    Campaign campaign;
    campaign.num_runs = num_runs;
    const Commit commit = [this](std::span<const Delivery> deliveries) {
      if (commit_failure) throw Error(*commit_failure);
      for (const Delivery& delivery : deliveries) {
        EXPECT_TRUE(stored.insert(delivery.result.run).second);
      }
    };
    const Log log = [this](const Event& event) {
      events.push_back(std::string(event.kind) + ' ' + event.text);
    };
    return std::make_unique<CampaignService>(std::make_shared<const Campaign>(campaign), finished,
                                             address, commit, log);
  }

  /// Serves in this thread while a worker's part runs in another.
  bool serve_with(CampaignService& service, const std::function<void()>& part) {
    std::thread thread(part);
    const bool is_finished = service.run(stop, [] {});
    thread.join();
    return is_finished;
  }

  PrivateEndpoint endpoint;
  std::atomic<StopRequest> stop = StopRequest::none;
  std::set<RunIndex> stored;
  std::vector<std::string> events;
  std::optional<std::string> commit_failure;
};

TEST_F(CampaignServiceTest, StoresEveryRunOnceAndStopsTheWorkers) {
  const auto service = make_service(1000, endpoint.address());
  EXPECT_TRUE(serve_with(*service, [&] { Peer(endpoint.address()).work(); }));
  EXPECT_EQ(stored.size(), 1000U);
  EXPECT_EQ(service->progress().num_done, 1000U);
  EXPECT_GT(service->progress().rate_hz, 0.0);
}

TEST_F(CampaignServiceTest, ServesAPortOnLoopback) {
  const auto service = make_service(10, "tcp://127.0.0.1:*");
  EXPECT_EQ(service->endpoint().substr(0, 16), "tcp://127.0.0.1:");
  EXPECT_TRUE(serve_with(*service, [&] { Peer(service->endpoint()).work(); }));
}

TEST_F(CampaignServiceTest, ComputesOnlyWhatIsMissing) {
  const auto service = make_service(10, endpoint.address(), {{{0}, 4}, {{6}, 4}});
  EXPECT_TRUE(serve_with(*service, [&] { Peer(endpoint.address()).work(); }));
  EXPECT_EQ(stored, (std::set<RunIndex>{{4}, {5}}));
}

TEST_F(CampaignServiceTest, RefusesAnAddressThatOthersCanReach) {
  try {
    (void)make_service(1, "tcp://0.0.0.0:7000");
    FAIL();
  } catch (const InvalidArgument& error) {
    EXPECT_EQ(std::string(error.what()),
              "bind = tcp://0.0.0.0:7000 (must be on loopback, 127.0.0.1 or [::1]: connections "
              "are not encrypted)");
  }
}

TEST_F(CampaignServiceTest, SaysThatAnAddressIsTaken) {
  const auto service = make_service(1, "tcp://127.0.0.1:*");
  try {
    (void)make_service(1, service->endpoint());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()),
              "bind = " + service->endpoint() + " (Address already in use)");
  }
}

TEST_F(CampaignServiceTest, ClosesOutWhoeverSendsGarbageAndServesTheOthers) {
  const auto service = make_service(10, endpoint.address());
  EXPECT_TRUE(serve_with(*service, [&] {
    Peer bad(endpoint.address());
    bad.say_hello();
    (void)bad.receive<wire::Welcome>();
    bad.send_bytes("garbage");
    const auto reject = bad.receive<wire::Reject>();
    EXPECT_EQ(reject.reason, wire::RejectReason::malformed);
    EXPECT_EQ(reject.text, "message = 7 bytes (must be an envelope)");
    bad.say_hello();  // Not listened to any more.
    Peer(endpoint.address()).work();
  }));
  EXPECT_EQ(stored.size(), 10U);
  EXPECT_EQ(events[1], "peer_closed_out worker=1 message = 7 bytes (must be an envelope)");
  EXPECT_EQ(events[2], "worker_gone worker=1 name=peer reason=protocol orbits=0");
  EXPECT_EQ(events[3].substr(0, 26), "worker_registered worker=2");
}

TEST_F(CampaignServiceTest, ClosesOutWhoeverSendsSeveralFramesOrAMessageOfACoordinator) {
  const auto service = make_service(1, endpoint.address());
  EXPECT_TRUE(serve_with(*service, [&] {
    Peer two(endpoint.address());
    two.send_two_frames();
    EXPECT_EQ(two.receive<wire::Reject>().text, "message = 2 frames (must be one)");
    Peer wrong(endpoint.address());
    wrong.send(wire::Stop{});
    EXPECT_EQ(wrong.receive<wire::Reject>().text,
              "message = one of a coordinator (must be one of a worker)");
    Peer(endpoint.address()).work();
  }));
}

TEST_F(CampaignServiceTest, TellsAPeerOfAnotherVersionThatItCannotTakePart) {
  const auto service = make_service(1, endpoint.address());
  EXPECT_TRUE(serve_with(*service, [&] {
    Peer old(endpoint.address());
    std::string bytes = wire::encode(wire::Bye{});
    bytes[1] = 99;  // The version is the first field of the envelope.
    old.send_bytes(bytes);
    const auto reject = old.receive<wire::Reject>();
    EXPECT_EQ(reject.reason, wire::RejectReason::incompatible);
    EXPECT_EQ(reject.text, "protocol_version = 99 (must be 1)");
    Peer(endpoint.address()).work();
  }));
}

TEST_F(CampaignServiceTest, StoresWhatWasDeliveredWhenStopped) {
  const auto service = make_service(5, endpoint.address());
  EXPECT_FALSE(serve_with(*service, [&] {
    Peer peer(endpoint.address());
    peer.deliver(peer.borrow());
    (void)peer.receive<wire::ResultAck>();
    stop = StopRequest::now;
    (void)peer.receive<wire::Stop>();
  }));
  EXPECT_EQ(stored.size(), 1U);
}

TEST_F(CampaignServiceTest, WaitsForHeldRunsWhenDrained) {
  const auto service = make_service(5, endpoint.address());
  EXPECT_FALSE(serve_with(*service, [&] {
    Peer peer(endpoint.address());
    const wire::RunLease lease = peer.borrow();
    stop = StopRequest::drain;
    (void)peer.receive<wire::Drain>();
    peer.deliver(lease);
    (void)peer.receive<wire::ResultAck>();
  }));
  EXPECT_EQ(stored.size(), 1U);
}

TEST_F(CampaignServiceTest, LendsAgainWhatAnEndedProcessHeld) {
  const auto service = make_service(1, endpoint.address());
  std::atomic<bool> has_ended = false;
  std::thread thread([&] {
    { (void)Peer(endpoint.address()).borrow(); }
    has_ended = true;
    Peer(endpoint.address()).work();
  });
  EXPECT_TRUE(service->run(stop, [&] {
    if (!has_ended.exchange(false)) return;
    EXPECT_EQ(to_text(service->runs_held_by(77)), "0");
    service->process_ended(77, "process_ended");
    EXPECT_EQ(to_text(service->runs_held_by(77)), "none");
  }));
  thread.join();
}

TEST_F(CampaignServiceTest, EndsWithTheReasonIfNothingCanBeStored) {
  commit_failure = "campaign file = x (disk full)";
  const auto service = make_service(1, endpoint.address());
  std::thread thread([&] {
    Peer peer(endpoint.address());
    peer.deliver(peer.borrow());
  });
  try {
    (void)service->run(stop, [] {});
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()), *commit_failure);
  }
  thread.join();
}

}  // namespace
}  // namespace proofmass::coordinator
