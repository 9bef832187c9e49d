#pragma once

#include <chrono>
#include <memory>

#include "coordinator/net/refusal_log.hpp"
#include "proto/link/security.hpp"

namespace zmq {
class context_t;
}  // namespace zmq

namespace proofmass::coordinator {

/// Notices peers that do not get as far as showing a key: those that use none, that trust another
/// coordinator's key, or that speak another protocol. ZeroMQ does not say where they are.
class HandshakeWatch {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  /// @param router  Handle of a ROUTER of that context; outlives the watch.
  /// @param log     Outlives the watch.
  /// @throws Error if the socket cannot be watched.
  HandshakeWatch(zmq::context_t& context, void* router, wire::Domain domain, RefusalLog& log);
  ~HandshakeWatch();
  HandshakeWatch(const HandshakeWatch&) = delete;
  HandshakeWatch& operator=(const HandshakeWatch&) = delete;

  /// Logs what happened; never waits.
  void update(TimePoint now);

 private:
  class Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace proofmass::coordinator
