#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/socket.hpp"
#include "tests/proto/link/raw_peer.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/test.hpp"

namespace proofmass::wire {
namespace {

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
                                           {.peers = KeyRole::worker, .keys = make_key_pair()});
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
      peer.let_pass(std::chrono::seconds(2));
      return (refusal = peer.monitor().take_refusal()).has_value();
    })) << greeting;
    EXPECT_EQ(refusal.value_or("none"),
              "coordinator = " + stranger.endpoint() +
                  " (breaks the connection off: it wants --keys, or is no coordinator)");
  }
}

// One that is stopped: the system accepts for it.
TEST(ConnectionMonitor, TellsAPeerThatDoesNotAnswerFromOneThatBreaksOff) {
  Stranger stranger("");
  Peer peer(stranger.endpoint(), {});
  EXPECT_TRUE(peer.until([&] { return peer.monitor().is_unanswered(); }));
  peer.let_pass(std::chrono::seconds(5));
  stranger.serve();
  EXPECT_EQ(peer.refusal(), "coordinator = " + stranger.endpoint() +
                                " (accepts the connection and does not answer: it is stopped or "
                                "overloaded, or no coordinator)");
}

TEST(ConnectionMonitor, AddressThatCanNeverBeConnectedIsAnError) {
  EXPECT_EQ(test::refusal_of([] { Peer peer("carrier-pigeon://home", {}); }),
            "connect = carrier-pigeon://home (Protocol not supported)");
}

using Clock = std::chrono::steady_clock;

constexpr std::int64_t mebibyte = 1 << 20;

TEST(Router, LimitsTheSizeOfAMessage) {
  zmq::context_t context;
  const auto router = [&](KeyRole domain) {
    return make_router(context, "bind", "tcp://127.0.0.1:*", {.peers = domain, .keys = {}});
  };
  EXPECT_EQ(router(KeyRole::worker).get(zmq::sockopt::maxmsgsize), mebibyte);
  EXPECT_EQ(router(KeyRole::client).get(zmq::sockopt::maxmsgsize), mebibyte);
  EXPECT_EQ(make_dealer(context, {}).get(zmq::sockopt::maxmsgsize), 4 * mebibyte);
}

TEST(Router, BindsAllKindsOfAddresses) {
  zmq::context_t context;
  const auto bound = [&](const std::string& endpoint) {
    return make_router(context, "bind", endpoint, {}).get(zmq::sockopt::last_endpoint);
  };
  EXPECT_EQ(bound("tcp://127.0.0.1:*").rfind("tcp://127.0.0.1:", 0), 0u);
  EXPECT_EQ(bound("tcp://lo:*").rfind("tcp://127.0.0.1:", 0), 0u);
  const std::string any = bound("tcp://*:*");
  EXPECT_TRUE(any.starts_with("tcp://[::]:") || any.starts_with("tcp://0.0.0.0:")) << any;
}

// A coordinator may be back for a few seconds only, and a client waits 10 s by default.
TEST(Dealer, OfAClientTriesAgainEachSecond) {
  zmq::context_t context;
  const auto interval_max = [&](KeyRole role) {
    const zmq::socket_t dealer = make_dealer(context, {}, role);
    EXPECT_EQ(dealer.get(zmq::sockopt::reconnect_ivl), 100);
    return dealer.get(zmq::sockopt::reconnect_ivl_max);
  };
  EXPECT_EQ(interval_max(KeyRole::client), 1000);
  EXPECT_EQ(interval_max(KeyRole::worker), 5000);
}

// A limit that is set but not obeyed is none.
TEST(Router, ClosesTheConnectionOfWhoSendsTooMuch) {
  zmq::context_t context;
  zmq::socket_t router = make_router(context, "bind", "tcp://127.0.0.1:*", {});
  zmq::socket_t dealer = make_dealer(context, {});
  ConnectionMonitor monitor(context, dealer, router.get(zmq::sockopt::last_endpoint), {},
                            Clock::now());
  bool is_sent = false;
  bool is_closed = false;
  const auto deadline = Clock::now() + std::chrono::seconds(20);
  while (!is_closed && Clock::now() < deadline) {
    zmq::pollitem_t item{monitor.handle(), 0, ZMQ_POLLIN, 0};
    zmq::poll(&item, 1, std::chrono::milliseconds(100));
    monitor.update(Clock::now());
    if (is_sent && !monitor.is_connected()) is_closed = true;
    if (!is_sent && monitor.is_connected()) {
      is_sent = dealer.send(zmq::message_t(mebibyte + 1), zmq::send_flags::dontwait).has_value();
    }
  }
  EXPECT_TRUE(is_closed);
  zmq::message_t frame;
  EXPECT_FALSE(router.recv(frame, zmq::recv_flags::dontwait));
}

// The socket must not fall back to admitting every key when the authenticator is missing.
TEST(Router, WithKeysAndWithoutAuthenticatorAdmitsNobody) {
  zmq::context_t context;
  zmq::context_t other_context;
  const KeyPair server = make_key_pair();
  const zmq::socket_t router =
      make_router(context, "bind", "tcp://127.0.0.1:*", {.peers = KeyRole::worker, .keys = server});
  const ClientSecurity security{.identity = CurveIdentity{.role = KeyRole::worker,
                                                          .keys = make_key_pair(),
                                                          .coordinator = server.public_key}};
  zmq::socket_t dealer = make_dealer(other_context, security);
  ConnectionMonitor monitor(other_context, dealer, router.get(zmq::sockopt::last_endpoint),
                            security, Clock::now());
  const auto deadline = Clock::now() + std::chrono::seconds(20);
  std::optional<std::string> refusal;
  while (!refusal && !monitor.is_connected() && Clock::now() < deadline) {
    zmq::pollitem_t item{monitor.handle(), 0, ZMQ_POLLIN, 0};
    zmq::poll(&item, 1, std::chrono::milliseconds(100));
    monitor.update(Clock::now());
    refusal = monitor.take_refusal();
  }
  EXPECT_FALSE(monitor.is_connected());
  EXPECT_TRUE(refusal.has_value());
}

// Peers that hang up while nobody reads what they sent. ZeroMQ 4.3.4 aborts the process if it has
// stopped to read from such a connection and then handles a ZMTP heartbeat, so each test is a
// process of its own.

using Clock = std::chrono::steady_clock;
using test::RawPeer;

// More than any limit in messages that a connection had.
constexpr int num_sent = 20000;

/// Messages, some of them interspersed with PINGs if the peer sends any.
std::string many_messages(bool has_pings) {
  std::string bytes;
  for (int i = 0; i < num_sent; ++i) {
    bytes += RawPeer::frame(0, "x");
    if (has_pings && i % 10 == 9) bytes += RawPeer::ping();
  }
  return bytes;
}

/// A router whose reader is busy, and a peer that sends and hangs up.
/// @return True if the router noticed and then gave all complete messages that it had taken.
bool survives(bool has_pings) {
  zmq::context_t context;
  zmq::socket_t router = make_router(context, "bind", "tcp://127.0.0.1:*", {});
  SocketEvents events(context, router.handle(), ZMQ_EVENT_DISCONNECTED);
  RawPeer peer(router.get(zmq::sockopt::last_endpoint));
  peer.introduce();
  peer.send(many_messages(has_pings));
  // Once one message can be received the first have arrived; the others follow.
  zmq::pollitem_t item{router.handle(), 0, ZMQ_POLLIN, 0};
  zmq::poll(&item, 1, std::chrono::seconds(20));
  peer.reset();
  // Without an end of the connection the program ends here, after the interval of a heartbeat.
  zmq::pollitem_t disconnected{events.handle(), 0, ZMQ_POLLIN, 0};
  zmq::poll(&disconnected, 1, std::chrono::seconds(10));
  const bool is_noticed = events.take().has_value();
  int num_received = 0;
  zmq::message_t frame;
  // Reading makes room, which makes the library go on with the connection.
  const auto deadline = Clock::now() + std::chrono::seconds(1);
  while (Clock::now() < deadline) {
    while (router.recv(frame, zmq::recv_flags::dontwait)) ++num_received;
    if (is_noticed) break;
  }
  return is_noticed && num_received > 0;
}

void expect_survival(bool has_pings) {
  EXPECT_EXIT(_exit(survives(has_pings) ? 0 : 1), testing::ExitedWithCode(0), "");
}

TEST(RouterDeathTest, SurvivesAPeerThatHangsUpWhileNobodyReads) { expect_survival(false); }

// The peer's own heartbeats make the library write, too.
TEST(RouterDeathTest, SurvivesAPeerThatPingsAndHangsUpWhileNobodyReads) { expect_survival(true); }

// What makes the two above possible: no queue of a connection can be full.
TEST(Router, HasNoQueueThatCanBeFullAndNoHeartbeats) {
  zmq::context_t context;
  const zmq::socket_t router = make_router(context, "bind", "tcp://127.0.0.1:*", {});
  const zmq::socket_t dealer = make_dealer(context, {});
  for (const zmq::socket_t* const socket : {&router, &dealer}) {
    EXPECT_EQ(socket->get(zmq::sockopt::rcvhwm), 0);
    EXPECT_EQ(socket->get(zmq::sockopt::heartbeat_ivl), 0);
    EXPECT_EQ(socket->get(zmq::sockopt::sndhwm), 1000);
  }
}

// A host that is gone says nothing any more: probes and missing confirmations show it.
TEST(Router, NoticesADeadHostIn20Seconds) {
  zmq::context_t context;
  const zmq::socket_t router = make_router(context, "bind", "tcp://127.0.0.1:*", {});
  const zmq::socket_t dealer = make_dealer(context, {});
  for (const zmq::socket_t* const socket : {&router, &dealer}) {
    EXPECT_EQ(socket->get(zmq::sockopt::tcp_keepalive), 1);
    const int probes_s = socket->get(zmq::sockopt::tcp_keepalive_intvl) *
                         socket->get(zmq::sockopt::tcp_keepalive_cnt);
    EXPECT_LE(socket->get(zmq::sockopt::tcp_keepalive_idle) + probes_s, 20);
    EXPECT_EQ(socket->get(zmq::sockopt::tcp_maxrt), 20000);
  }
}

}  // namespace
}  // namespace proofmass::wire
