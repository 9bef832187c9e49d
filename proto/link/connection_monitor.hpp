#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "proto/link/keys.hpp"

namespace zmq {
class context_t;
class socket_t;
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
  ConnectionMonitor(const ConnectionMonitor&) = delete;
  ConnectionMonitor& operator=(const ConnectionMonitor&) = delete;

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
