#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/worker_gateway.hpp"
#include "proto/link/connection_monitor.hpp"
#include "proto/link/faults.hpp"
#include "proto/link/security.hpp"

namespace zmq {
class context_t;
}  // namespace zmq

namespace proofmass::coordinator {

/// The socket at one of a coordinator's doors. It never waits.
///
/// One thread uses it; another may close and open it meanwhile, to free what it holds. Peers then
/// connect anew to the same address, and what was under way is lost.
class RouterSocket {
 public:
  /// Binds the socket.
  ///
  /// @param option  Name of the option that the endpoint comes from, for messages.
  /// @param faults  What shall go wrong with the messages, for tests of this program.
  /// @throws Error as wire::make_router() does.
  RouterSocket(zmq::context_t& context, std::string_view option, const std::string& endpoint,
               const wire::ServerSecurity& security, const std::optional<wire::FaultPlan>& faults);
  ~RouterSocket();
  RouterSocket(const RouterSocket&) = delete;
  RouterSocket& operator=(const RouterSocket&) = delete;

  /// Keeps the socket from being closed while it is polled.
  [[nodiscard]] std::unique_lock<std::mutex> hold() const;
  /// Socket to poll for ZMQ_POLLIN, as in zmq::pollitem_t, while it is held; null if it is closed.
  [[nodiscard]] void* handle() const;

  /// The address to connect to, with the port that was chosen.
  [[nodiscard]] const std::string& endpoint() const;

  /// The next handshake that failed, if there are keys.
  [[nodiscard]] std::optional<wire::SocketEvent> take_event();

  /// Hands the next messages to `handle`, as many as there are and at most `count_max`.
  void receive(int count_max, TimePoint now, const std::function<void(const Incoming&)>& handle);

  /// False if the peer is gone or its queue is full, or the socket is closed.
  bool send(const std::string& routing_id, const std::string& bytes, TimePoint now);

  /// Ends all connections and drops what they hold, soon; from any thread.
  void close();
  /// Binds a closed socket to the address that it had; from any thread. False if that is not
  /// possible now.
  [[nodiscard]] bool open();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proofmass::coordinator
