#pragma once

#include <cstdint>
#include <memory>
#include <optional>

namespace zmq {
class context_t;
}  // namespace zmq

namespace proofmass::wire {

/// Something that happened to a connection of a socket, as in zmq_socket_monitor(3).
struct SocketEvent {
  int kind = 0;             ///< ZMQ_EVENT_...
  std::uint32_t value = 0;  ///< What it means depends on the kind.
};

/// What happens to the connections of one socket.
class SocketEvents {
 public:
  /// @param socket  Handle of a socket of that context; outlives the object.
  /// @param kinds   ZMQ_EVENT_... to be seen, joined by |.
  /// @throws Error if the socket cannot be watched.
  SocketEvents(zmq::context_t& context, void* socket, int kinds);
  ~SocketEvents();
  SocketEvents(const SocketEvents&) = delete;
  SocketEvents& operator=(const SocketEvents&) = delete;

  /// Socket to poll for ZMQ_POLLIN, as in zmq::pollitem_t.
  [[nodiscard]] void* handle() const;

  /// The next event; nothing if none has happened.
  [[nodiscard]] std::optional<SocketEvent> take();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proofmass::wire
