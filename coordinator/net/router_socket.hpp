#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/dispatch/state.hpp"
#include "proto/link/faults.hpp"
#include "proto/link/keys.hpp"
#include "proto/link/socket.hpp"

namespace zmq {
class context_t;
class message_t;
class socket_t;
}  // namespace zmq

namespace proofmass::coordinator {

/// Where a message came from, as the transport has it.
struct Address {
  std::string routing_id;  ///< Of the connection; another one after each reconnection.
  std::string key;         ///< Public key in Z85; empty on a connection without keys.
  /// For people: `10.0.0.7`, or `localhost:UID:GID:PID` on a Unix domain socket; may be empty.
  std::string host;
};

struct Incoming {
  Address from;
  std::vector<std::string_view> frames;  ///< Valid while the message is handled.
};

/// The socket at one of a coordinator's addresses. It never waits.
///
/// One thread uses it; another may close and open it meanwhile, to free what it holds. Peers then
/// connect anew to the same address, and what was under way is lost.
class RouterSocket {
 public:
  /// Binds the socket.
  ///
  /// @param option  Name of the option that the endpoint comes from, for messages.
  /// @param listener  As for wire::make_router().
  /// @throws Error as wire::make_router() does.
  RouterSocket(zmq::context_t& context, std::string_view option, const std::string& endpoint,
               const wire::ServerSecurity& security, std::optional<int> listener = std::nullopt);
  ~RouterSocket();

  /// Keeps the socket from being closed while it is polled.
  [[nodiscard]] std::unique_lock<std::mutex> hold() { return std::unique_lock(mutex_); }
  /// Socket to poll for ZMQ_POLLIN, as in zmq::pollitem_t, while it is held; null if it is closed.
  [[nodiscard]] void* handle() const;

  /// The address to connect to, with the port that was chosen.
  [[nodiscard]] const std::string& endpoint() const { return endpoint_; }

  /// Whether messages come late on purpose.
  [[nodiscard]] bool has_faults() const { return sending_ != nullptr; }

  /// The next handshake that failed, if there are keys.
  [[nodiscard]] std::optional<wire::SocketEvent> take_event();

  /// Hands the next messages to `handle`, as many as there are and at most `count_max`.
  /// @return Their number.
  int receive(int count_max, TimePoint now, const std::function<void(const Incoming&)>& handle);

  /// False if the peer is gone or its queue is full, or the socket is closed.
  bool send(const std::string& routing_id, const std::string& bytes, TimePoint now);

  /// Ends all connections and drops what they hold, soon; from any thread.
  void close();
  /// Binds a closed socket to the address that it had; from any thread. False if that is not
  /// possible now.
  [[nodiscard]] bool open();

 private:
  void bind(const std::string& endpoint, std::optional<int> listener);
  void wait_for_unbound();
  /// @param frames  Hold the bytes of the message.
  /// @return False if there is none.
  [[nodiscard]] bool next(Incoming& incoming, std::vector<zmq::message_t>& frames);
  void pass_due(TimePoint now, const std::function<void(const Incoming&)>& handle);
  bool send_now(const std::string& routing_id, const std::string& bytes);

  zmq::context_t& context_;
  std::string option_;
  wire::ServerSecurity security_;
  std::string endpoint_;
  std::mutex mutex_;                             ///< For the socket and its events.
  std::unique_ptr<zmq::socket_t> socket_;        ///< Null while it is closed.
  std::unique_ptr<wire::SocketEvents> events_;   ///< Of the socket: gone before it.
  std::unique_ptr<wire::LinkFaults> sending_;    ///< Null unless faults are planned.
  std::unique_ptr<wire::LinkFaults> receiving_;  ///< Null unless faults are planned.
  std::map<std::string, Address> addresses_;     ///< Of those whose messages are delayed.
};

}  // namespace proofmass::coordinator
