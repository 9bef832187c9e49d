// Peers that hang up while nobody reads what they sent. ZeroMQ 4.3.4 aborts the process if it has
// stopped to read from such a connection and then handles a ZMTP heartbeat, so each test is a
// process of its own.

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <string>
#include <zmq.hpp>

#include "proto/link/connection_monitor.hpp"
#include "proto/link/socket.hpp"
#include "tests/proto/link/raw_peer.hpp"

namespace proofmass::wire {
namespace {

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
