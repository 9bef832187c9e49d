#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/worker_desk.hpp"
#include "proto/link/faults.hpp"
#include "proto/link/security.hpp"

namespace zmq {
class context_t;
}  // namespace zmq

namespace proofmass::coordinator {

/// The socket at one of a coordinator's doors. It never waits.
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

  /// Socket to poll for ZMQ_POLLIN, as in zmq::pollitem_t.
  [[nodiscard]] void* handle() const;

  /// The address to connect to, with the port that was chosen.
  [[nodiscard]] std::string endpoint() const;

  /// Hands the next messages to `handle`, as many as there are and at most `count_max`.
  void receive(int count_max, TimePoint now, const std::function<void(const Incoming&)>& handle);

  /// False if the peer is gone or its queue is full.
  bool send(const std::string& routing_id, const std::string& bytes, TimePoint now);

 private:
  class Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace proofmass::coordinator
