#include "coordinator/net/router_socket.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <map>
#include <vector>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/socket.hpp"

namespace proofmass::coordinator {
namespace {

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

class RouterSocket::Parts {
 public:
  Parts(zmq::socket_t socket, const std::optional<wire::FaultPlan>& faults)
      : socket_(std::move(socket)) {
    if (!faults) return;
    faults_.emplace(Faults{{*faults, wire::FaultyLink::Direction::sending},
                           {*faults, wire::FaultyLink::Direction::receiving},
                           {}});
  }

  [[nodiscard]] zmq::socket_t& socket() { return socket_; }

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

 private:
  struct Faults {
    wire::FaultyLink sending;
    wire::FaultyLink receiving;
    std::map<std::string, Address> addresses;  ///< Of those whose messages are delayed.
  };

  std::optional<Received> next() {
    zmq::message_t routing_id;
    if (!socket_.recv(routing_id, zmq::recv_flags::dontwait)) return std::nullopt;
    Received received;
    received.from.routing_id = routing_id.to_string();
    while (socket_.get(zmq::sockopt::rcvmore)) {
      // The parts of a message arrive together.
      (void)socket_.recv(received.frames.emplace_back());
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
    try {
      const auto flags = zmq::send_flags::dontwait | zmq::send_flags::sndmore;
      if (!socket_.send(zmq::buffer(routing_id), flags)) return false;
      return socket_.send(zmq::buffer(bytes), zmq::send_flags::dontwait).has_value();
    } catch (const zmq::error_t& error) {
      if (error.num() == EHOSTUNREACH) return false;
      throw Error(fmt::format("socket: {}", error.what()));
    }
  }

  zmq::socket_t socket_;
  std::optional<Faults> faults_;
};

RouterSocket::RouterSocket(zmq::context_t& context, std::string_view option,
                           const std::string& endpoint, const wire::ServerSecurity& security,
                           const std::optional<wire::FaultPlan>& faults)
    : parts_(std::make_unique<Parts>(wire::make_router(context, option, endpoint, security),
                                     faults)) {}

RouterSocket::~RouterSocket() = default;

void* RouterSocket::handle() const { return parts_->socket().handle(); }

std::string RouterSocket::endpoint() const {
  return parts_->socket().get(zmq::sockopt::last_endpoint);
}

void RouterSocket::receive(int count_max, TimePoint now,
                           const std::function<void(const Incoming&)>& handle) {
  parts_->receive(count_max, now, handle);
}

bool RouterSocket::send(const std::string& routing_id, const std::string& bytes, TimePoint now) {
  return parts_->send(routing_id, bytes, now);
}

}  // namespace proofmass::coordinator
