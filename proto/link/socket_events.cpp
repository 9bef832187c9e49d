#include "proto/link/socket_events.hpp"

#include <fmt/format.h>

#include <atomic>
#include <cstdint>
#include <cstring>
#include <string>
#include <zmq.hpp>

#include "core/error.hpp"

namespace proofmass::wire {
namespace {

/// A name that no other socket had: the library forgets that of a closed one some time later.
std::string new_address() {
  static std::atomic<std::uint64_t> count = 0;
  return fmt::format("inproc://socket-events-{}", ++count);
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

}  // namespace proofmass::wire
