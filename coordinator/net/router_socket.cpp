#include "coordinator/net/router_socket.hpp"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <vector>
#include <zmq.hpp>

#include "coordinator/net/authentication/authenticator.hpp"
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

}  // namespace

RouterSocket::RouterSocket(zmq::context_t& context, std::string_view option,
                           const std::string& endpoint, const wire::ServerSecurity& security,
                           std::optional<int> listener)
    : context_(context), option_(option), security_(security) {
  bind(endpoint, listener);
  endpoint_ = socket_->get(zmq::sockopt::last_endpoint);
  if (security_.peers == wire::KeyRole::client) return;
  sending_ = wire::link_faults(wire::LinkFaults::Direction::sending);
  receiving_ = wire::link_faults(wire::LinkFaults::Direction::receiving);
}

RouterSocket::~RouterSocket() = default;

void* RouterSocket::handle() const { return socket_ == nullptr ? nullptr : socket_->handle(); }

std::optional<wire::SocketEvent> RouterSocket::take_event() {
  const std::lock_guard lock(mutex_);
  return events_ == nullptr ? std::nullopt : events_->take();
}

int RouterSocket::receive(int count_max, TimePoint now,
                          const std::function<void(const Incoming&)>& handle) {
  int count = 0;
  for (; count < count_max; ++count) {
    Incoming incoming;
    std::vector<zmq::message_t> frames;
    if (!next(incoming, frames)) break;
    if (!receiving_ || frames.size() != 1) {
      handle(incoming);
      continue;
    }
    addresses_[incoming.from.routing_id] = incoming.from;
    receiving_->pass(incoming.from.routing_id, frames.front().to_string(), now);
  }
  if (receiving_) pass_due(now, handle);
  return count;
}

bool RouterSocket::send(const std::string& routing_id, const std::string& bytes, TimePoint now) {
  if (!sending_) return send_now(routing_id, bytes);
  sending_->pass(routing_id, bytes, now);
  return true;
}

void RouterSocket::close() {
  const std::lock_guard lock(mutex_);
  if (socket_ == nullptr) return;
  try {
    // Otherwise the address would be in use until the library has ended all connections.
    socket_->unbind(endpoint_);
    wait_for_unbound();
    socket_->set(zmq::sockopt::linger, 0);
  } catch (const zmq::error_t&) {
    // It is closed anyway; open() says whether the address can be had.
  }
  events_.reset();
  socket_.reset();
}

bool RouterSocket::open() {
  const std::lock_guard lock(mutex_);
  if (socket_ != nullptr) return true;
  try {
    bind(endpoint_, std::nullopt);
    return true;
  } catch (const Error&) {
  } catch (const zmq::error_t&) {  // No descriptor left, for one.
  }
  events_.reset();
  socket_.reset();
  return false;
}

void RouterSocket::bind(const std::string& endpoint, std::optional<int> listener) {
  socket_ = std::make_unique<zmq::socket_t>(
      wire::make_router(context_, option_, endpoint, security_, listener));
  const int kinds = ZMQ_EVENT_CLOSED | (security_.keys ? failed_handshakes : 0);
  events_ = std::make_unique<wire::SocketEvents>(context_, socket_->handle(), kinds);
}

void RouterSocket::wait_for_unbound() {
  const auto deadline = std::chrono::steady_clock::now() + unbind_time_max;
  while (std::chrono::steady_clock::now() < deadline) {
    while (const auto event = events_->take()) {
      if (event->kind == ZMQ_EVENT_CLOSED) return;
    }
    std::array<zmq::pollitem_t, 1> item{{{events_->handle(), 0, ZMQ_POLLIN, 0}}};
    zmq::poll(item, unbind_time_max / 10);
  }
}

bool RouterSocket::next(Incoming& incoming, std::vector<zmq::message_t>& frames) {
  const std::lock_guard lock(mutex_);
  zmq::message_t routing_id;
  if (socket_ == nullptr || !socket_->recv(routing_id, zmq::recv_flags::dontwait)) return false;
  incoming.from.routing_id = routing_id.to_string();
  while (socket_->get(zmq::sockopt::rcvmore)) {
    // The parts of a message arrive together.
    if (frames.size() < frames_max) frames.emplace_back();
    (void)socket_->recv(frames.back());
  }
  if (frames.empty()) return true;
  incoming.from.key = property_of(frames.front(), "User-Id");
  incoming.from.host = property_of(frames.front(), "Peer-Address");
  for (const zmq::message_t& frame : frames) incoming.frames.push_back(frame.to_string_view());
  return true;
}

void RouterSocket::pass_due(TimePoint now, const std::function<void(const Incoming&)>& handle) {
  for (const wire::Parcel& parcel : receiving_->due(now)) {
    handle({.from = addresses_.at(parcel.routing), .frames = {parcel.bytes}});
  }
  for (const wire::Parcel& parcel : sending_->due(now)) {
    (void)send_now(parcel.routing, parcel.bytes);
  }
}

bool RouterSocket::send_now(const std::string& routing_id, const std::string& bytes) {
  const std::lock_guard lock(mutex_);
  if (socket_ == nullptr) return false;
  try {
    const auto flags = zmq::send_flags::dontwait | zmq::send_flags::sndmore;
    if (!socket_->send(zmq::buffer(routing_id), flags)) return false;
    return socket_->send(zmq::buffer(bytes), zmq::send_flags::dontwait).has_value();
  } catch (const zmq::error_t& error) {
    if (error.num() == EHOSTUNREACH) return false;
    throw Error(fmt::format("socket: {}", error.what()));
  }
}

}  // namespace proofmass::coordinator
