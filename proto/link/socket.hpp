#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "proto/link/keys.hpp"
#include "proto/link/whole_file.hpp"

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

/// Why the host of an address to connect to has no address, for people; empty if it has one. Waits
/// for the answer.
/// @param endpoint  check_endpoint() holds.
[[nodiscard]] std::string reason_if_unknown(const std::string& endpoint);

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

  /// Socket to poll for ZMQ_POLLIN, as in zmq::pollitem_t.
  [[nodiscard]] void* handle() const;

  /// The next event; nothing if none has happened.
  [[nodiscard]] std::optional<SocketEvent> take();

 private:
  void* socket_;
  std::unique_ptr<zmq::socket_t> events_;
};

/// Keeps a DEALER connected and says why it is not. ZeroMQ by itself tells nobody about a refusal,
/// and after one it never tries again: a key that is put on the list later would not help.
class ConnectionMonitor {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  /// Connects the socket, in the background.
  ///
  /// @param dealer    From make_dealer(), with the same security; outlives the monitor.
  /// @param endpoint  check_endpoint() holds.
  /// @throws Error reading `connect = endpoint (reason)` if that can never be connected.
  ConnectionMonitor(zmq::context_t& context, zmq::socket_t& dealer, std::string endpoint,
                    const ClientSecurity& security, TimePoint now);

  /// Socket to poll for ZMQ_POLLIN, as in zmq::pollitem_t.
  [[nodiscard]] void* handle() const { return events_.handle(); }

  /// Takes in what happened and connects again what was refused, after a pause of 1 s that doubles
  /// to 30 s. Never waits. To be called when the handle is readable and once a second or more
  /// often.
  void update(TimePoint now);

  /// True from a complete handshake to the loss of that connection.
  [[nodiscard]] bool is_connected() const { return is_connected_; }

  /// True if the peer has accepted the connection and not yet answered, as one that is stopped.
  [[nodiscard]] bool is_unanswered() const { return accepted_at_.has_value(); }

  /// Why the peer at the address does not let this program in, for people; once for each reason
  /// until a connection succeeds.
  [[nodiscard]] std::optional<std::string> take_refusal() { return std::exchange(news_, {}); }

 private:
  using Duration = std::chrono::steady_clock::duration;

  void take_in(const SocketEvent& event, TimePoint now);
  void refused(const std::string& text, TimePoint now);
  void report_break();
  void report(const std::string& text);
  void connect();
  void reconnect(TimePoint now);

  zmq::socket_t& dealer_;
  std::string endpoint_;
  ClientSecurity security_;
  SocketEvents events_;
  bool is_connected_ = false;
  std::optional<TimePoint> accepted_at_;  ///< Of a connection whose handshake is not over.
  int num_breaks_ = 0;                    ///< Handshakes broken off without a reason, in a row.
  std::set<std::string> reported_;        ///< Since the last connection.
  std::optional<std::string> news_;
  std::optional<TimePoint> retry_at_;
  Duration pause_;
  TimePoint last_sign_at_;
};

}  // namespace proofmass::wire
