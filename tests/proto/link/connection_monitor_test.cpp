#include "proto/link/connection_monitor.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/socket.hpp"
#include "tests/proto/link/scratch_directory.hpp"

namespace proofmass::wire {
namespace {

using ::testing::AnyOf;
using Clock = std::chrono::steady_clock;

// Someone who connects. Its clock runs as fast as the test wants.
class Peer {
 public:
  Peer(const std::string& endpoint, const ClientSecurity& security)
      : dealer_(make_dealer(context_, security)),
        monitor_(context_, dealer_, endpoint, security, now_) {}

  // Lets things happen until `is_enough`, or 20 s of real time have passed.
  bool until(const std::function<bool()>& is_enough) {
    const auto deadline = Clock::now() + std::chrono::seconds(20);
    while (!is_enough()) {
      if (Clock::now() > deadline) return false;
      zmq::pollitem_t item{monitor_.handle(), 0, ZMQ_POLLIN, 0};
      zmq::poll(&item, 1, std::chrono::milliseconds(20));
      monitor_.update(now_);
    }
    return true;
  }

  std::string refusal() {
    std::optional<std::string> text;
    until([&] { return (text = monitor_.take_refusal()).has_value(); });
    return text.value_or("none");
  }

  bool connects() {
    return until([&] { return monitor_.is_connected(); });
  }

  ConnectionMonitor& monitor() { return monitor_; }
  void let_pass(std::chrono::seconds duration) { now_ += duration; }

 private:
  Clock::time_point now_{};
  zmq::context_t context_;
  zmq::socket_t dealer_;
  ConnectionMonitor monitor_;
};

ClientSecurity worker_of(const PublicKey& coordinator) {
  return {.identity = CurveIdentity{
              .role = KeyRole::worker, .keys = make_key_pair(), .coordinator = coordinator}};
}

constexpr const char* other_key_rule =
    "breaks the connection off: it has another key than coordinator.pub, or none, or is no "
    "coordinator";

std::string endpoint_of(const zmq::socket_t& socket) {
  return socket.get(zmq::sockopt::last_endpoint);
}

TEST(ConnectionMonitor, SeesTheConnectionComeAndGo) {
  zmq::context_t context;
  zmq::socket_t router = make_router(context, "bind", "tcp://127.0.0.1:*", {});
  Peer peer(endpoint_of(router), {});
  EXPECT_FALSE(peer.monitor().is_connected());
  ASSERT_TRUE(peer.connects());
  router.close();
  EXPECT_TRUE(peer.until([&] { return !peer.monitor().is_connected(); }));
  EXPECT_FALSE(peer.monitor().take_refusal());
}

TEST(ConnectionMonitor, ConnectsByNameAndBySocketFile) {
  const test::ScratchDirectory directory;
  zmq::context_t context;
  for (const std::string& address :
       {std::string("tcp://127.0.0.1:*"), "ipc://" + (directory / "socket").string()}) {
    const zmq::socket_t router = make_router(context, "bind", address, {});
    std::string endpoint = endpoint_of(router);
    if (const std::size_t host = endpoint.find("127.0.0.1"); host != std::string::npos) {
      endpoint.replace(host, 9, "localhost");
    }
    EXPECT_TRUE(Peer(endpoint, {}).connects()) << endpoint;
  }
}

std::string mismatch(const std::string& endpoint, const std::string& rule) {
  return "coordinator = " + endpoint + " (" + rule + ")";
}

TEST(ConnectionMonitor, TellsAPeerWithKeysThatTheCoordinatorUsesNone) {
  zmq::context_t context;
  const zmq::socket_t router = make_router(context, "bind", "tcp://127.0.0.1:*", {});
  const std::string endpoint = endpoint_of(router);
  Peer peer(endpoint, worker_of(make_key_pair().public_key));
  EXPECT_THAT(peer.refusal(), AnyOf(mismatch(endpoint, "uses no keys: start it with --keys too"),
                                    mismatch(endpoint, other_key_rule)));
}

TEST(ConnectionMonitor, SaysEachReasonOnce) {
  zmq::context_t context;
  const zmq::socket_t router = make_router(context, "bind", "tcp://127.0.0.1:*",
                                           {.domain = Domain::workers, .keys = make_key_pair()});
  Peer peer(endpoint_of(router), {});
  std::multiset<std::string> reasons;
  int num_turns = 0;
  EXPECT_TRUE(peer.until([&] {
    if (const auto reason = peer.monitor().take_refusal()) reasons.insert(*reason);
    peer.let_pass(std::chrono::seconds(40));  // Each turn connects again.
    return ++num_turns > 40 && !reasons.empty();
  }));
  for (const std::string& reason : reasons) EXPECT_EQ(reasons.count(reason), 1u) << reason;
}

// A listener that says the same to everybody and then breaks off or, if patient, waits.
class Stranger {
 public:
  enum class Manner { breaks_off, waits };

  explicit Stranger(std::string greeting, Manner manner = Manner::breaks_off)
      : greeting_(std::move(greeting)), manner_(manner) {
    listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0);
    const int on = 1;  // Its address is soon used again.
    ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    ::bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof address);
    ::listen(listener_, 8);
    socklen_t size = sizeof address;
    ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
  }
  ~Stranger() {
    for (const int connection : waiting_) ::close(connection);
    ::close(listener_);
  }
  Stranger(const Stranger&) = delete;
  Stranger& operator=(const Stranger&) = delete;

  [[nodiscard]] std::string endpoint() const { return "tcp://127.0.0.1:" + std::to_string(port_); }

  void serve() {
    const int connection = ::accept(listener_, nullptr, nullptr);
    if (connection < 0) return;
    [[maybe_unused]] const auto sent = ::send(connection, greeting_.data(), greeting_.size(), 0);
    if (manner_ == Manner::waits) {
      waiting_.push_back(connection);
    } else {
      ::close(connection);
    }
  }

 private:
  std::string greeting_;
  Manner manner_;
  std::vector<int> waiting_;
  int listener_;
  int port_;
};

// The 64 bytes with which a coordinator that wants keys begins: ZMTP 3.0, section 2.2.
std::string greeting_with_keys() {
  std::string greeting(64, '\0');
  greeting[0] = '\xff';
  greeting[9] = '\x7f';
  greeting[10] = 3;
  greeting.replace(12, 5, "CURVE");
  greeting[32] = 1;
  return greeting;
}

// After a refusal ZeroMQ never connects again by itself. A coordinator might break off before the
// peer has read why, and then it does.
TEST(ConnectionMonitor, ConnectsAgainAfterARefusal) {
  std::optional<Stranger> strict(std::in_place, greeting_with_keys(), Stranger::Manner::waits);
  const std::string endpoint = strict->endpoint();
  Peer peer(endpoint, {});
  std::optional<std::string> refusal;
  ASSERT_TRUE(peer.until([&] {
    strict->serve();
    return (refusal = peer.monitor().take_refusal()).has_value();
  }));
  EXPECT_EQ(*refusal, mismatch(endpoint, "admits only who has a key: give --keys"));
  strict.reset();
  zmq::context_t context;
  const zmq::socket_t open = make_router(context, "bind", endpoint, {});

  int num_turns = 0;
  peer.until([&] { return ++num_turns > 10 || peer.monitor().is_connected(); });
  EXPECT_FALSE(peer.monitor().is_connected());
  peer.let_pass(std::chrono::seconds(1));

  EXPECT_TRUE(peer.connects());
}

TEST(ConnectionMonitor, TellsThatThePeerIsNoCoordinator) {
  for (const std::string& greeting :
       {std::string(), std::string("HTTP/1.1 400 Bad Request\r\n\r\n"), std::string(64, '\x01')}) {
    Stranger stranger(greeting);
    Peer peer(stranger.endpoint(), {});
    std::optional<std::string> refusal;
    EXPECT_TRUE(peer.until([&] {
      stranger.serve();
      peer.let_pass(std::chrono::seconds(31));
      return (refusal = peer.monitor().take_refusal()).has_value();
    })) << greeting;
    EXPECT_EQ(refusal.value_or("none"),
              "coordinator = " + stranger.endpoint() +
                  " (breaks the connection off: it wants --keys, or is no coordinator)");
  }
}

TEST(ConnectionMonitor, AddressThatCanNeverBeConnectedIsAnError) {
  EXPECT_EQ(test::refusal_of([] { Peer peer("carrier-pigeon://home", {}); }),
            "connect = carrier-pigeon://home (Protocol not supported)");
}

}  // namespace
}  // namespace proofmass::wire
