#include "proto/link/socket.hpp"

#include <fmt/format.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/wire/codec.hpp"
#include "proto/wire/endpoint.hpp"

namespace proofmass::wire {
namespace {

// Times in ms.
// A host that is gone is noticed within 20 s, whether or not something is under way to it: by
// probes after 10 s without traffic, or because what was sent is not confirmed.
constexpr int tcp_idle_s = 10;
constexpr int tcp_probe_interval_s = 3;
constexpr int tcp_probe_count = 3;
constexpr int tcp_unconfirmed_max = 20000;
// Intervals double from the least to the most. A person waits for a client, and the coordinator may
// be there for a few seconds only. Workers come by the thousand: with the longer interval their
// handshakes are spread, and they are back within the 15 s that a new coordinator waits for them.
constexpr int reconnect_interval_min = 100;
constexpr int reconnect_interval_max_of_client = 1000;
constexpr int reconnect_interval_max_of_worker = 5000;
constexpr int linger_of_router = 1000;
constexpr int linger_of_dealer = 2000;

// Messages that wait for their reader in one connection; 0 is any number. A queue that fills makes
// ZeroMQ 4.3.4 stop reading from the connection, and abort the process if the peer hangs up then
// and a ZMTP heartbeat, ours or the peer's, is handled afterwards (stream_engine_base.cpp,
// out_event(): `!_io_error`). No queue can be full that has no limit in messages. What bounds them
// is the coordinator's limit on its memory (coordinator/net/service_sockets.hpp), in bytes and for
// all connections together.
constexpr int unread_count_max = 0;
// Messages that wait to be sent to one peer. A worker may be told of many ranges and results at a
// time; a peer that does not read them loses them, and the protocol repeats what matters.
constexpr int unsent_count_max = 1000;

void limit(zmq::socket_t& socket, std::size_t message_size, int linger) {
  socket.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(message_size));
  socket.set(zmq::sockopt::rcvhwm, unread_count_max);
  socket.set(zmq::sockopt::sndhwm, unsent_count_max);
  socket.set(zmq::sockopt::linger, linger);
  socket.set(zmq::sockopt::handshake_ivl, static_cast<int>(handshake_duration_max.count()));
  // ZMTP's heartbeats stay off, for the same reason: the protocol has its own.
  socket.set(zmq::sockopt::tcp_keepalive, 1);
  socket.set(zmq::sockopt::tcp_keepalive_idle, tcp_idle_s);
  socket.set(zmq::sockopt::tcp_keepalive_intvl, tcp_probe_interval_s);
  socket.set(zmq::sockopt::tcp_keepalive_cnt, tcp_probe_count);
  socket.set(zmq::sockopt::tcp_maxrt, tcp_unconfirmed_max);
}

/// Without an authenticator nobody gets in, instead of everybody. The library takes this option
/// although its header declares it for drafts only.
void enforce_domain(zmq::socket_t& socket) {
  constexpr int zap_enforce_domain = 93;
  const int is_on = 1;
  if (zmq_setsockopt(socket.handle(), zap_enforce_domain, &is_on, sizeof is_on) != 0) {
    throw Error(fmt::format("ZeroMQ: ZAP_ENFORCE_DOMAIN: {}", zmq_strerror(zmq_errno())));
  }
}

}  // namespace

zmq::socket_t make_router(zmq::context_t& context, std::string_view option,
                          const std::string& endpoint, const ServerSecurity& security,
                          std::optional<int> listener) {
  zmq::socket_t socket(context, zmq::socket_type::router);
  limit(socket, router_message_size_max, linger_of_router);
  socket.set(zmq::sockopt::router_mandatory, true);
  if (security.keys) {
    socket.set(zmq::sockopt::curve_server, true);
    socket.set(zmq::sockopt::curve_secretkey, security.keys->secret_key.reveal());
    socket.set(zmq::sockopt::zap_domain, std::string(to_text(security.domain)));
    enforce_domain(socket);
  }
  socket.set(zmq::sockopt::ipv6, may_be_ipv6(endpoint, EndpointUse::bind));
  if (listener) socket.set(zmq::sockopt::use_fd, *listener);
  try {
    socket.bind(endpoint);
  } catch (const zmq::error_t& error) {
    throw Error(fmt::format("{} = {} ({})", option, endpoint, error.what()));
  }
  return socket;
}

zmq::socket_t make_dealer(zmq::context_t& context, const ClientSecurity& security, KeyRole role) {
  zmq::socket_t socket(context, zmq::socket_type::dealer);
  limit(socket, message_size_max, linger_of_dealer);
  // Without a connection nothing is queued: a peer that needs an answer asks again.
  socket.set(zmq::sockopt::immediate, true);
  socket.set(zmq::sockopt::reconnect_ivl, reconnect_interval_min);
  socket.set(zmq::sockopt::reconnect_ivl_max, role == KeyRole::client
                                                  ? reconnect_interval_max_of_client
                                                  : reconnect_interval_max_of_worker);
  if (security.identity) {
    socket.set(zmq::sockopt::curve_serverkey, security.identity->coordinator.text());
    socket.set(zmq::sockopt::curve_publickey, security.identity->keys.public_key.text());
    socket.set(zmq::sockopt::curve_secretkey, security.identity->keys.secret_key.reveal());
  }
  return socket;
}

Wake::Wake() : descriptor_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (descriptor() < 0) throw Error(fmt::format("eventfd: {}", std::strerror(errno)));
}

void Wake::notify() const {
  const std::uint64_t one = 1;
  // It fails only if the counter is full, and then the descriptor is readable already.
  [[maybe_unused]] const auto written = write(descriptor(), &one, sizeof one);
}

bool Wake::take() const {
  std::uint64_t count = 0;
  return read(descriptor(), &count, sizeof count) == sizeof count;
}

}  // namespace proofmass::wire
