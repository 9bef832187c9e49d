#include "proto/link/socket.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/connection_monitor.hpp"
#include "tests/proto/link/scratch_directory.hpp"

namespace proofmass::wire {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::int64_t mebibyte = 1 << 20;

TEST(Router, LimitsTheSizeOfAMessage) {
  zmq::context_t context;
  const auto router = [&](Domain domain) {
    return make_router(context, "bind", "tcp://127.0.0.1:*", {.domain = domain, .keys = {}});
  };
  EXPECT_EQ(router(Domain::workers).get(zmq::sockopt::maxmsgsize), mebibyte);
  EXPECT_EQ(router(Domain::clients).get(zmq::sockopt::maxmsgsize), mebibyte);
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
  const zmq::socket_t router = make_router(context, "bind", "tcp://127.0.0.1:*",
                                           {.domain = Domain::workers, .keys = server});
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

}  // namespace
}  // namespace proofmass::wire
