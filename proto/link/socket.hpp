#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

#include "proto/link/descriptor.hpp"
#include "proto/link/keys.hpp"

// Only sources see the whole of these.
namespace zmq {
class context_t;
class socket_t;
}  // namespace zmq

namespace proofmass::wire {

// Sockets with every option set that the protocol relies on: limits on the size of messages and on
// the time for a handshake, dead hosts noticed within 20 s, nothing queued for peers that are not
// there. The sender of a message never waits: send with zmq::send_flags::dontwait. The number of
// messages that wait to be received has no limit: a process that others can reach must watch its
// memory.

/// After it, ZeroMQ gives up a peer that does not answer.
inline constexpr std::chrono::milliseconds handshake_duration_max{5000};

/// A ROUTER, bound. With keys, an Authenticator must be bound in the same context before:
/// peers that come earlier are refused.
///
/// @param option    Name of the option that the endpoint comes from, for the message.
/// @param endpoint  check_endpoint() holds; the port may be `*`.
/// @param listener  A socket that listens there already and that this one takes over; none: one is
///                  made.
/// @throws Error reading `option = endpoint (reason)` if it cannot be bound.
[[nodiscard]] zmq::socket_t make_router(zmq::context_t& context, std::string_view option,
                                        const std::string& endpoint, const ServerSecurity& security,
                                        std::optional<int> listener = std::nullopt);

/// A DEALER, not connected yet: a ConnectionMonitor connects it.
/// @param role  Worker or client, with or without keys: while nobody is there a client tries again
///              at least once a second, a worker every 5 s.
[[nodiscard]] zmq::socket_t make_dealer(zmq::context_t& context, const ClientSecurity& security,
                                        KeyRole role = KeyRole::worker);

/// Wakes a loop that polls file descriptors, from any thread.
class Wake {
 public:
  Wake();  ///< @throws Error if the system has no descriptor left.

  /// Readable from a notify() to the next take().
  [[nodiscard]] int descriptor() const { return descriptor_.number(); }
  void notify() const;
  /// True if notify() was called since the last time.
  [[nodiscard]] bool take() const;

 private:
  Descriptor descriptor_;
};

}  // namespace proofmass::wire
