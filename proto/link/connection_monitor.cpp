#include "proto/link/connection_monitor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <set>
#include <string>
#include <utility>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/wire/endpoint.hpp"

namespace proofmass::wire {
namespace {

/// A name that no other socket had: the library forgets that of a closed one some time later.
std::string new_address() {
  static std::atomic<std::uint64_t> count = 0;
  return fmt::format("inproc://socket-events-{}", ++count);
}

using Duration = std::chrono::steady_clock::duration;
using TimePoint = ConnectionMonitor::TimePoint;

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

}  // namespace

class SocketEvents::Impl {
 public:
  Impl(zmq::context_t& context, void* socket, int kinds)
      : socket_(socket), events_(context, zmq::socket_type::pair) {
    const std::string address = new_address();
    if (zmq_socket_monitor(socket_, address.c_str(), kinds) != 0) {
      throw Error(fmt::format("zmq_socket_monitor: {}", zmq_strerror(zmq_errno())));
    }
    // Otherwise the library's own thread would wait for a reader that is busy, and all connections
    // with it.
    events_.set(zmq::sockopt::rcvhwm, 0);
    events_.connect(address);
  }
  ~Impl() { zmq_socket_monitor(socket_, nullptr, 0); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  [[nodiscard]] void* handle() { return events_.handle(); }

  std::optional<SocketEvent> take() {
    zmq::message_t frame;
    zmq::message_t address;
    if (!events_.recv(frame, zmq::recv_flags::dontwait)) return std::nullopt;
    (void)events_.recv(address);  // The parts of a message arrive together.
    std::uint16_t kind = 0;
    SocketEvent event;
    PROOFMASS_EXPECT(frame.size() == sizeof kind + sizeof event.value);
    std::memcpy(&kind, frame.data(), sizeof kind);
    std::memcpy(&event.value, frame.data<char>() + sizeof kind, sizeof event.value);
    event.kind = kind;
    return event;
  }

 private:
  void* socket_;
  zmq::socket_t events_;
};

SocketEvents::SocketEvents(zmq::context_t& context, void* socket, int kinds)
    : impl_(std::make_unique<Impl>(context, socket, kinds)) {}

SocketEvents::~SocketEvents() = default;

void* SocketEvents::handle() const { return impl_->handle(); }
std::optional<SocketEvent> SocketEvents::take() { return impl_->take(); }

class ConnectionMonitor::Impl {
 public:
  Impl(zmq::context_t& context, zmq::socket_t& dealer, std::string endpoint,
       const ClientSecurity& security, TimePoint now)
      : dealer_(dealer),
        endpoint_(std::move(endpoint)),
        security_(security),
        events_(context, dealer.handle(), watched_events),
        last_sign_at_(now) {
    connect();
  }

  [[nodiscard]] void* handle() const { return events_.handle(); }
  [[nodiscard]] bool is_connected() const { return is_connected_; }
  [[nodiscard]] std::optional<std::string> take_refusal() { return std::exchange(news_, {}); }

  void update(TimePoint now) {
    while (const auto event = events_.take()) {
      last_sign_at_ = now;
      take_in(*event, now);
    }
    if (is_connected_) return;
    if (now - last_sign_at_ >= silence_max) retry_at_ = now;
    if (retry_at_ && now >= *retry_at_) reconnect(now);
  }

 private:
  void take_in(const SocketEvent& event, TimePoint now) {
    switch (event.kind) {
      case ZMQ_EVENT_HANDSHAKE_SUCCEEDED:
        is_connected_ = true;
        num_breaks_ = 0;
        pause_ = pause_min;
        reported_.clear();
        news_.reset();
        retry_at_.reset();
        break;
      case ZMQ_EVENT_DISCONNECTED:
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
        if (++num_breaks_ >= breaks_before_report) report(broken_off_text(endpoint_, security_));
        break;
      default:
        break;
    }
  }

  void refused(const std::string& text, TimePoint now) {
    report(text);
    retry_at_ = now + pause_;
    pause_ = std::min(2 * pause_, pause_max);
  }

  void report(const std::string& text) {
    // Which end notices first is a matter of chance, so reasons may alternate.
    if (reported_.insert(text).second) news_ = text;
  }

  void connect() {
    try {
      dealer_.set(zmq::sockopt::ipv6, may_be_ipv6(endpoint_, EndpointUse::connect));
      dealer_.connect(endpoint_);
    } catch (const zmq::error_t& error) {
      throw Error(fmt::format("connect = {} ({})", endpoint_, error.what()));
    }
  }

  void reconnect(TimePoint now) {
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

  zmq::socket_t& dealer_;
  std::string endpoint_;
  ClientSecurity security_;
  SocketEvents events_;
  bool is_connected_ = false;
  int num_breaks_ = 0;              ///< Handshakes broken off without a reason, in a row.
  std::set<std::string> reported_;  ///< Since the last connection.
  std::optional<std::string> news_;
  std::optional<TimePoint> retry_at_;
  Duration pause_ = pause_min;
  TimePoint last_sign_at_;
};

ConnectionMonitor::ConnectionMonitor(zmq::context_t& context, zmq::socket_t& dealer,
                                     std::string endpoint, const ClientSecurity& security,
                                     TimePoint now)
    : impl_(std::make_unique<Impl>(context, dealer, std::move(endpoint), security, now)) {}

ConnectionMonitor::~ConnectionMonitor() = default;

void* ConnectionMonitor::handle() const { return impl_->handle(); }
void ConnectionMonitor::update(TimePoint now) { impl_->update(now); }
bool ConnectionMonitor::is_connected() const { return impl_->is_connected(); }
std::optional<std::string> ConnectionMonitor::take_refusal() { return impl_->take_refusal(); }

}  // namespace proofmass::wire
