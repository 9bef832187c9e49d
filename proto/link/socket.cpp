#include "proto/link/socket.hpp"

#include <fmt/format.h>
#include <netdb.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <string>
#include <utility>
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

/// Whether a socket listens at an ipc:// address. The library takes its path away from it.
bool is_taken(const std::string& endpoint) {
  constexpr std::string_view scheme = "ipc://";
  sockaddr_un address{.sun_family = AF_UNIX, .sun_path = {}};
  if (!endpoint.starts_with(scheme) || endpoint.size() - scheme.size() >= sizeof address.sun_path) {
    return false;
  }
  std::ranges::copy(endpoint.substr(scheme.size()), std::begin(address.sun_path));
  const Descriptor caller(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const auto* const place = reinterpret_cast<const sockaddr*>(&address);
  return connect(caller.number(), place, sizeof address) == 0 || errno == EAGAIN;
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
    socket.set(zmq::sockopt::zap_domain, domain_of(security.peers));
    enforce_domain(socket);
  }
  socket.set(zmq::sockopt::ipv6, may_be_ipv6(endpoint, EndpointUse::bind));
  if (listener) socket.set(zmq::sockopt::use_fd, *listener);
  if (!listener && is_taken(endpoint)) {
    throw Error(fmt::format("{} = {} ({})", option, endpoint, zmq_strerror(EADDRINUSE)));
  }
  try {
    socket.bind(endpoint);
  } catch (const zmq::error_t& error) {
    const std::string_view why =
        error.num() == ENODEV
            ? "must be *, an IP address of this machine or the name of an interface as lo"
            : error.what();
    throw Error(fmt::format("{} = {} ({})", option, endpoint, why));
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

std::string reason_if_unknown(const std::string& endpoint) {
  constexpr std::string_view scheme = "tcp://";
  if (!endpoint.starts_with(scheme)) return {};
  const std::size_t end = endpoint.rfind(':');
  std::string host = endpoint.substr(scheme.size(), end - scheme.size());
  if (host.starts_with('[')) return {};
  addrinfo* found = nullptr;
  const int error = getaddrinfo(host.c_str(), nullptr, nullptr, &found);
  if (error == 0) freeaddrinfo(found);
  return error == 0 ? "" : fmt::format("host {}: {}", host, gai_strerror(error));
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

namespace {

/// A name that no other socket had: the library forgets that of a closed one some time later.
std::string new_address() {
  static std::atomic<std::uint64_t> count = 0;
  return fmt::format("inproc://socket-events-{}", ++count);
}

using Duration = std::chrono::steady_clock::duration;

constexpr int watched_events =
    ZMQ_EVENT_CONNECTED | ZMQ_EVENT_CONNECT_RETRIED | ZMQ_EVENT_DISCONNECTED |
    ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL |
    ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL | ZMQ_EVENT_HANDSHAKE_FAILED_AUTH;

constexpr Duration pause_min = std::chrono::seconds(1);
constexpr Duration pause_max = std::chrono::seconds(30);
/// ZeroMQ gives a connection up for good on some errors; it is trying if there are events.
constexpr Duration silence_max = std::chrono::seconds(30);
/// A coordinator that ends during a handshake breaks it off too, but hardly twice.
constexpr int breaks_before_report = 2;

std::string refused_key_text(const std::string& endpoint, const CurveIdentity& identity) {
  return fmt::format(
      "key = {} (refused by the coordinator at {}: must be in its authorized_{}s, and this its "
      "address for {}s)",
      identity.keys.public_key.text(), endpoint, to_text(identity.role), to_text(identity.role));
}

std::string mismatch_text(const std::string& endpoint, const ClientSecurity& security) {
  return fmt::format("coordinator = {} ({})", endpoint,
                     security.identity ? "uses no keys: start it with --keys too"
                                       : "admits only who has a key: give --keys");
}

std::string broken_off_text(const std::string& endpoint, const ClientSecurity& security) {
  return fmt::format("coordinator = {} (breaks the connection off: {})", endpoint,
                     security.identity
                         ? "it has another key than coordinator.pub, or none, or is no "
                           "coordinator"
                         : "it wants --keys, or is no coordinator");
}

/// Who breaks a handshake off does so at once; ZeroMQ gives up one that nobody answers after
/// handshake_duration_max.
constexpr Duration silent_handshake_min = handshake_duration_max / 2;

std::string unanswered_text(const std::string& endpoint) {
  return fmt::format(
      "coordinator = {} (accepts the connection and does not answer: it is stopped or overloaded, "
      "or no coordinator)",
      endpoint);
}

}  // namespace

SocketEvents::SocketEvents(zmq::context_t& context, void* socket, int kinds)
    : socket_(socket), events_(std::make_unique<zmq::socket_t>(context, zmq::socket_type::pair)) {
  const std::string address = new_address();
  if (zmq_socket_monitor(socket_, address.c_str(), kinds) != 0) {
    throw Error(fmt::format("zmq_socket_monitor: {}", zmq_strerror(zmq_errno())));
  }
  // Otherwise the library's own thread would wait for a reader that is busy, and all connections
  // with it.
  events_->set(zmq::sockopt::rcvhwm, 0);
  events_->connect(address);
}

SocketEvents::~SocketEvents() { zmq_socket_monitor(socket_, nullptr, 0); }

void* SocketEvents::handle() const { return events_->handle(); }

std::optional<SocketEvent> SocketEvents::take() {
  zmq::message_t frame;
  zmq::message_t address;
  if (!events_->recv(frame, zmq::recv_flags::dontwait)) return std::nullopt;
  (void)events_->recv(address);  // The parts of a message arrive together.
  std::uint16_t kind = 0;
  SocketEvent event;
  PROOFMASS_EXPECT(frame.size() == sizeof kind + sizeof event.value);
  std::memcpy(&kind, frame.data(), sizeof kind);
  std::memcpy(&event.value, frame.data<char>() + sizeof kind, sizeof event.value);
  event.kind = kind;
  return event;
}

ConnectionMonitor::ConnectionMonitor(zmq::context_t& context, zmq::socket_t& dealer,
                                     std::string endpoint, const ClientSecurity& security,
                                     TimePoint now)
    : dealer_(dealer),
      endpoint_(std::move(endpoint)),
      security_(security),
      events_(context, dealer.handle(), watched_events),
      pause_(pause_min),
      last_sign_at_(now) {
  connect();
}

void ConnectionMonitor::update(TimePoint now) {
  while (const auto event = events_.take()) {
    last_sign_at_ = now;
    take_in(*event, now);
  }
  if (is_connected_) return;
  if (now - last_sign_at_ >= silence_max) retry_at_ = now;
  if (retry_at_ && now >= *retry_at_) reconnect(now);
}

void ConnectionMonitor::take_in(const SocketEvent& event, TimePoint now) {
  const std::optional<TimePoint> accepted_at = std::exchange(accepted_at_, std::nullopt);
  switch (event.kind) {
    case ZMQ_EVENT_CONNECTED:
      accepted_at_ = now;
      break;
    case ZMQ_EVENT_HANDSHAKE_SUCCEEDED:
      is_connected_ = true;
      num_breaks_ = 0;
      pause_ = pause_min;
      reported_.clear();
      news_.reset();
      retry_at_.reset();
      break;
    case ZMQ_EVENT_DISCONNECTED:
      // A server of something else, whose answer ZeroMQ takes for one of its first version.
      if (!is_connected_ && accepted_at) report_break();
      is_connected_ = false;
      break;
    case ZMQ_EVENT_HANDSHAKE_FAILED_AUTH:
      refused(security_.identity ? refused_key_text(endpoint_, *security_.identity)
                                 : mismatch_text(endpoint_, security_),
              now);
      break;
    case ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL:
      refused(event.value == ZMQ_PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH
                  ? mismatch_text(endpoint_, security_)
                  : broken_off_text(endpoint_, security_),
              now);
      break;
    case ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL:
      // ZeroMQ tries again by itself.
      if (accepted_at && now - *accepted_at >= silent_handshake_min) {
        report(unanswered_text(endpoint_));
      } else {
        report_break();
      }
      break;
    default:
      break;
  }
}

void ConnectionMonitor::refused(const std::string& text, TimePoint now) {
  report(text);
  retry_at_ = now + pause_;
  pause_ = std::min(2 * pause_, pause_max);
}

void ConnectionMonitor::report_break() {
  if (++num_breaks_ >= breaks_before_report) report(broken_off_text(endpoint_, security_));
}

void ConnectionMonitor::report(const std::string& text) {
  // Which end notices first is a matter of chance, so reasons may alternate.
  if (reported_.insert(text).second) news_ = text;
}

void ConnectionMonitor::connect() {
  try {
    dealer_.set(zmq::sockopt::ipv6, may_be_ipv6(endpoint_, EndpointUse::connect));
    dealer_.connect(endpoint_);
  } catch (const zmq::error_t& error) {
    throw Error(fmt::format("connect = {} ({})", endpoint_, error.what()));
  }
}

void ConnectionMonitor::reconnect(TimePoint now) {
  try {
    dealer_.disconnect(endpoint_);
  } catch (const zmq::error_t& error) {
    // A socket that ZeroMQ has given up already may have nothing to disconnect.
    if (error.num() != ENOENT)
      throw Error(fmt::format("connect = {} ({})", endpoint_, error.what()));
  }
  connect();
  retry_at_.reset();
  last_sign_at_ = now;
}

}  // namespace proofmass::wire
