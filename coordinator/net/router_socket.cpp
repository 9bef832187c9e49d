#include "coordinator/net/router_socket.hpp"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>
#include <zmq.hpp>

#include "coordinator/net/authentication/refusal_log.hpp"
#include "core/error.hpp"
#include "proto/link/socket.hpp"

namespace proofmass::coordinator {
namespace {

// Enough to say that they are too many.
constexpr std::size_t frames_max = 16;
// The library's thread closes an address as soon as it gets to it.
constexpr std::chrono::seconds unbind_time_max(2);

/// A property of a message's connection; empty if there is none.
std::string property_of(zmq::message_t& message, const char* name) {
  const char* const value = zmq_msg_gets(message.handle(), name);
  return value == nullptr ? "" : value;
}

/// A message with the frames that hold its bytes.
struct Received {
  Address from;
  std::vector<zmq::message_t> frames;
};

Incoming view_of(const Received& received) {
  Incoming incoming{.from = received.from, .frames = {}};
  for (const zmq::message_t& frame : received.frames) {
    incoming.frames.push_back(frame.to_string_view());
  }
  return incoming;
}

}  // namespace

class RouterSocket::Impl {
 public:
  Impl(zmq::context_t& context, std::string_view option, const std::string& endpoint,
       const wire::ServerSecurity& security, const std::optional<wire::FaultPlan>& faults)
      : context_(context), option_(option), security_(security) {
    bind(endpoint);
    endpoint_ = socket_.get(zmq::sockopt::last_endpoint);
    if (!faults) return;
    faults_.emplace(Faults{{*faults, wire::FaultyLink::Direction::sending},
                           {*faults, wire::FaultyLink::Direction::receiving},
                           {}});
  }

  [[nodiscard]] std::unique_lock<std::mutex> hold() { return std::unique_lock(mutex_); }
  [[nodiscard]] void* handle() { return socket_.handle(); }
  [[nodiscard]] const std::string& endpoint() const { return endpoint_; }

  [[nodiscard]] std::optional<wire::SocketEvent> take_event() {
    const std::lock_guard lock(mutex_);
    return events_ == nullptr ? std::nullopt : events_->take();
  }

  void receive(int count_max, TimePoint now, const std::function<void(const Incoming&)>& handle) {
    for (int i = 0; i < count_max; ++i) {
      const std::optional<Received> received = next();
      if (!received) break;
      if (!faults_ || received->frames.size() != 1) {
        handle(view_of(*received));
        continue;
      }
      faults_->addresses[received->from.routing_id] = received->from;
      faults_->receiving.pass(received->from.routing_id, received->frames.front().to_string(), now);
    }
    if (faults_) pass_due(now, handle);
  }

  bool send(const std::string& routing_id, const std::string& bytes, TimePoint now) {
    if (!faults_) return send_now(routing_id, bytes);
    faults_->sending.pass(routing_id, bytes, now);
    return true;
  }

  void close() {
    const std::lock_guard lock(mutex_);
    if (!socket_) return;
    try {
      // Otherwise the address would be in use until the library has ended all connections.
      socket_.unbind(endpoint_);
      wait_for_unbound();
      socket_.set(zmq::sockopt::linger, 0);
    } catch (const zmq::error_t&) {
      // It is closed anyway; open() says whether the address can be had.
    }
    events_.reset();
    socket_.close();
  }

  [[nodiscard]] bool open() {
    const std::lock_guard lock(mutex_);
    if (socket_) return true;
    try {
      bind(endpoint_);
      return true;
    } catch (const Error&) {
    } catch (const zmq::error_t&) {  // No descriptor left, for one.
    }
    events_.reset();
    socket_.close();
    return false;
  }

 private:
  struct Faults {
    wire::FaultyLink sending;
    wire::FaultyLink receiving;
    std::map<std::string, Address> addresses;  ///< Of those whose messages are delayed.
  };

  void bind(const std::string& endpoint) {
    socket_ = wire::make_router(context_, option_, endpoint, security_);
    const int kinds = ZMQ_EVENT_CLOSED | (security_.keys ? failed_handshakes : 0);
    events_ = std::make_unique<wire::SocketEvents>(context_, socket_.handle(), kinds);
  }

  void wait_for_unbound() {
    const auto deadline = std::chrono::steady_clock::now() + unbind_time_max;
    while (std::chrono::steady_clock::now() < deadline) {
      while (const auto event = events_->take()) {
        if (event->kind == ZMQ_EVENT_CLOSED) return;
      }
      std::array<zmq::pollitem_t, 1> item{{{events_->handle(), 0, ZMQ_POLLIN, 0}}};
      zmq::poll(item, unbind_time_max / 10);
    }
  }

  std::optional<Received> next() {
    const std::lock_guard lock(mutex_);
    zmq::message_t routing_id;
    if (!socket_ || !socket_.recv(routing_id, zmq::recv_flags::dontwait)) return std::nullopt;
    Received received;
    received.from.routing_id = routing_id.to_string();
    while (socket_.get(zmq::sockopt::rcvmore)) {
      // The parts of a message arrive together.
      if (received.frames.size() < frames_max) received.frames.emplace_back();
      (void)socket_.recv(received.frames.back());
    }
    if (received.frames.empty()) return received;
    received.from.key = property_of(received.frames.front(), "User-Id");
    received.from.host = property_of(received.frames.front(), "Peer-Address");
    return received;
  }

  void pass_due(TimePoint now, const std::function<void(const Incoming&)>& handle) {
    for (const wire::Parcel& parcel : faults_->receiving.due(now)) {
      handle({.from = faults_->addresses.at(parcel.routing), .frames = {parcel.bytes}});
    }
    for (const wire::Parcel& parcel : faults_->sending.due(now)) {
      (void)send_now(parcel.routing, parcel.bytes);
    }
  }

  bool send_now(const std::string& routing_id, const std::string& bytes) {
    const std::lock_guard lock(mutex_);
    if (!socket_) return false;
    try {
      const auto flags = zmq::send_flags::dontwait | zmq::send_flags::sndmore;
      if (!socket_.send(zmq::buffer(routing_id), flags)) return false;
      return socket_.send(zmq::buffer(bytes), zmq::send_flags::dontwait).has_value();
    } catch (const zmq::error_t& error) {
      if (error.num() == EHOSTUNREACH) return false;
      throw Error(fmt::format("socket: {}", error.what()));
    }
  }

  zmq::context_t& context_;
  std::string option_;
  wire::ServerSecurity security_;
  std::string endpoint_;
  std::mutex mutex_;  ///< For the socket and its events.
  zmq::socket_t socket_;
  std::unique_ptr<wire::SocketEvents> events_;  ///< Of the socket: gone before it.
  std::optional<Faults> faults_;
};

RouterSocket::RouterSocket(zmq::context_t& context, std::string_view option,
                           const std::string& endpoint, const wire::ServerSecurity& security,
                           const std::optional<wire::FaultPlan>& faults)
    : impl_(std::make_unique<Impl>(context, option, endpoint, security, faults)) {}

RouterSocket::~RouterSocket() = default;

std::unique_lock<std::mutex> RouterSocket::hold() const { return impl_->hold(); }

void* RouterSocket::handle() const { return impl_->handle(); }

const std::string& RouterSocket::endpoint() const { return impl_->endpoint(); }

std::optional<wire::SocketEvent> RouterSocket::take_event() { return impl_->take_event(); }

void RouterSocket::receive(int count_max, TimePoint now,
                           const std::function<void(const Incoming&)>& handle) {
  impl_->receive(count_max, now, handle);
}

bool RouterSocket::send(const std::string& routing_id, const std::string& bytes, TimePoint now) {
  return impl_->send(routing_id, bytes, now);
}

void RouterSocket::close() { impl_->close(); }

bool RouterSocket::open() { return impl_->open(); }

}  // namespace proofmass::coordinator
