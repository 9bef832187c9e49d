#include "worker/net/coordinator_link.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <utility>
#include <vector>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/connection_monitor.hpp"
#include "proto/link/faults.hpp"
#include "proto/link/socket.hpp"

namespace proofmass::worker {
namespace {

TimePoint steady_now() { return std::chrono::steady_clock::now(); }

std::chrono::milliseconds milliseconds_up(Duration time) {
  return std::chrono::ceil<std::chrono::milliseconds>(std::max(Duration::zero(), time));
}

}  // namespace

struct CoordinatorLink::Connection {
  Connection(const std::string& endpoint, const wire::ClientSecurity& security)
      : socket(wire::make_dealer(context, security)),
        monitor(context, socket, endpoint, security, steady_now()) {}

  zmq::context_t context;
  zmq::socket_t socket;
  wire::ConnectionMonitor monitor;
  // Null unless something shall go wrong.
  std::unique_ptr<wire::LinkFaults> sending =
      wire::link_faults(wire::LinkFaults::Direction::sending);
  std::unique_ptr<wire::LinkFaults> receiving =
      wire::link_faults(wire::LinkFaults::Direction::receiving);
  bool was_connected = false;
  bool is_newly_connected = false;  ///< The connection is new, and nobody has been told.
  bool can_send = false;            ///< At the last look; looked at only while nobody was told.
};

CoordinatorLink::CoordinatorLink(const std::string& endpoint, const wire::ClientSecurity& security)
    : endpoint_(endpoint), security_(security) {
  connect();
}

CoordinatorLink::~CoordinatorLink() = default;

void CoordinatorLink::connect() {
  try {
    connection_ = std::make_unique<Connection>(endpoint_, security_);
  } catch (const zmq::error_t& error) {
    throw Error(fmt::format("connect = {} ({})", endpoint_, error.what()));
  }
}

bool CoordinatorLink::has_faults() const { return connection_->sending != nullptr; }

void CoordinatorLink::reconnect() {
  connection_->socket.set(zmq::sockopt::linger, 0);
  connect();
}

void CoordinatorLink::wait(std::span<const int> descriptors, Duration time_max) {
  auto& [context, socket, monitor, sending, receiving, was_connected, is_newly_connected,
         can_send] = *connection_;
  // A connection takes messages only some time after its handshake.
  const short wanted = is_newly_connected ? ZMQ_POLLIN | ZMQ_POLLOUT : ZMQ_POLLIN;
  std::vector<zmq::pollitem_t> items{{socket.handle(), 0, wanted, 0},
                                     {monitor.handle(), 0, ZMQ_POLLIN, 0}};
  for (const int descriptor : descriptors) items.push_back({nullptr, descriptor, ZMQ_POLLIN, 0});
  try {
    zmq::poll(items, milliseconds_up(time_max));
  } catch (const zmq::error_t& error) {
    // A process that was stopped and continued comes back here.
    if (error.num() != EINTR) throw;
  }
  monitor.update(steady_now());
  const bool is_connected = monitor.is_connected();
  is_newly_connected = is_connected && (is_newly_connected || !was_connected);
  was_connected = is_connected;
  can_send = (items[0].revents & ZMQ_POLLOUT) != 0;
}

void CoordinatorLink::send(std::string bytes, TimePoint now) {
  if (!connection_->sending) return transmit(bytes);
  connection_->sending->pass("", std::move(bytes), now);
  transmit_due(now);
}

void CoordinatorLink::receive(TimePoint now, const std::function<bool(std::string_view)>& handle) {
  transmit_due(now);
  wire::LinkFaults* const faults = connection_->receiving.get();
  zmq::message_t frame;
  while (connection_->socket.recv(frame, zmq::recv_flags::dontwait)) {
    if (faults != nullptr) {
      faults->pass("", frame.to_string(), now);
    } else if (!handle(frame.to_string_view())) {
      return;
    }
  }
  if (faults == nullptr) return;
  for (const wire::Parcel& parcel : faults->due(now)) {
    if (!handle(parcel.bytes)) return;
  }
}

bool CoordinatorLink::take_connected() {
  return connection_->can_send && std::exchange(connection_->is_newly_connected, false);
}

std::optional<std::string> CoordinatorLink::take_refusal() {
  return connection_->monitor.take_refusal();
}

void CoordinatorLink::transmit_due(TimePoint now) {
  if (!connection_->sending) return;
  for (const wire::Parcel& parcel : connection_->sending->due(now)) transmit(parcel.bytes);
}

void CoordinatorLink::transmit(const std::string& bytes) {
  // What the queue has no room for is lost; the conversation repeats what is not answered.
  (void)connection_->socket.send(zmq::buffer(bytes), zmq::send_flags::dontwait);
}

}  // namespace proofmass::worker
