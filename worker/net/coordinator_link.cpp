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

class CoordinatorLink::Impl {
 public:
  Impl(const std::string& endpoint, const wire::ClientSecurity& security)
      : socket_(wire::make_dealer(context_, security)),
        monitor_(context_, socket_, endpoint, security, steady_now()) {}

  [[nodiscard]] bool has_faults() const { return sending_ != nullptr; }

  void wait(std::span<const int> descriptors, Duration time_max) {
    // A connection takes messages only some time after its handshake.
    const short wanted = is_newly_connected_ ? ZMQ_POLLIN | ZMQ_POLLOUT : ZMQ_POLLIN;
    std::vector<zmq::pollitem_t> items{{socket_.handle(), 0, wanted, 0},
                                       {monitor_.handle(), 0, ZMQ_POLLIN, 0}};
    for (const int descriptor : descriptors) items.push_back({nullptr, descriptor, ZMQ_POLLIN, 0});
    try {
      zmq::poll(items, milliseconds_up(time_max));
    } catch (const zmq::error_t& error) {
      // A process that was stopped and continued comes back here.
      if (error.num() != EINTR) throw;
    }
    monitor_.update(steady_now());
    const bool is_connected = monitor_.is_connected();
    is_newly_connected_ = is_connected && (is_newly_connected_ || !was_connected_);
    was_connected_ = is_connected;
    can_send_ = (items[0].revents & ZMQ_POLLOUT) != 0;
  }

  void send(std::string bytes, TimePoint now) {
    if (!sending_) return transmit(bytes);
    sending_->pass("", std::move(bytes), now);
    transmit_due(now);
  }

  void receive(TimePoint now, const std::function<bool(std::string_view)>& handle) {
    transmit_due(now);
    zmq::message_t frame;
    while (socket_.recv(frame, zmq::recv_flags::dontwait)) {
      if (receiving_) {
        receiving_->pass("", frame.to_string(), now);
      } else if (!handle(frame.to_string_view())) {
        return;
      }
    }
    if (!receiving_) return;
    for (const wire::Parcel& parcel : receiving_->due(now)) {
      if (!handle(parcel.bytes)) return;
    }
  }

  void drop_unsent() { socket_.set(zmq::sockopt::linger, 0); }

  bool take_connected() { return can_send_ && std::exchange(is_newly_connected_, false); }
  std::optional<std::string> take_refusal() { return monitor_.take_refusal(); }

 private:
  void transmit_due(TimePoint now) {
    if (!sending_) return;
    for (const wire::Parcel& parcel : sending_->due(now)) transmit(parcel.bytes);
  }

  void transmit(const std::string& bytes) {
    // What the queue has no room for is lost; the conversation repeats what is not answered.
    (void)socket_.send(zmq::buffer(bytes), zmq::send_flags::dontwait);
  }

  zmq::context_t context_;
  zmq::socket_t socket_;
  wire::ConnectionMonitor monitor_;
  // Null unless something shall go wrong.
  std::unique_ptr<wire::LinkFaults> sending_ =
      wire::link_faults(wire::LinkFaults::Direction::sending);
  std::unique_ptr<wire::LinkFaults> receiving_ =
      wire::link_faults(wire::LinkFaults::Direction::receiving);
  bool was_connected_ = false;
  bool is_newly_connected_ = false;  ///< The connection is new, and nobody has been told.
  bool can_send_ = false;            ///< At the last look; looked at only while nobody was told.
};

CoordinatorLink::CoordinatorLink(const std::string& endpoint, const wire::ClientSecurity& security)
    : endpoint_(endpoint), security_(security), impl_(make_impl()) {}

std::unique_ptr<CoordinatorLink::Impl> CoordinatorLink::make_impl() const {
  try {
    return std::make_unique<Impl>(endpoint_, security_);
  } catch (const zmq::error_t& error) {
    throw Error(fmt::format("connect = {} ({})", endpoint_, error.what()));
  }
}

CoordinatorLink::~CoordinatorLink() = default;

bool CoordinatorLink::has_faults() const { return impl_->has_faults(); }

void CoordinatorLink::reconnect() {
  impl_->drop_unsent();
  impl_ = make_impl();
}

void CoordinatorLink::wait(std::span<const int> descriptors, Duration time_max) {
  impl_->wait(descriptors, time_max);
}

void CoordinatorLink::send(std::string bytes, TimePoint now) { impl_->send(std::move(bytes), now); }

void CoordinatorLink::receive(TimePoint now, const std::function<bool(std::string_view)>& handle) {
  impl_->receive(now, handle);
}

bool CoordinatorLink::take_connected() { return impl_->take_connected(); }

std::optional<std::string> CoordinatorLink::take_refusal() { return impl_->take_refusal(); }

}  // namespace proofmass::worker
