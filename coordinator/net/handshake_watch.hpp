#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <utility>

#include "coordinator/net/refusal_log.hpp"
#include "proto/link/security.hpp"
#include "proto/link/socket_events.hpp"

namespace proofmass::coordinator {

/// Events that a HandshakeWatch looks for: ZMQ_EVENT_..., joined by |.
extern const int failed_handshakes;

/// Notices peers that do not get as far as showing a key: those that use none, that trust another
/// coordinator's key, or that speak another protocol. ZeroMQ does not say where they are.
class HandshakeWatch {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;
  /// The next event of a socket, if there is one.
  using EventSource = std::function<std::optional<wire::SocketEvent>()>;

  /// @param log  Outlives the watch.
  HandshakeWatch(EventSource next_event, wire::Domain domain, RefusalLog& log)
      : next_event_(std::move(next_event)), domain_(domain), log_(log) {}

  /// Logs what happened; never waits.
  void update(TimePoint now);

 private:
  EventSource next_event_;
  wire::Domain domain_;
  RefusalLog& log_;
};

}  // namespace proofmass::coordinator
