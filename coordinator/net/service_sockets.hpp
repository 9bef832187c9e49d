#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "coordinator/net/authentication/authenticator.hpp"
#include "coordinator/net/memory_guard.hpp"
#include "coordinator/net/router_socket.hpp"
#include "coordinator/net/service.hpp"
#include "proto/link/socket.hpp"

namespace proofmass::coordinator {

/// The sockets of a service: one for workers, perhaps one for clients, and one at which the library
/// asks who may connect. For one thread.
///
/// A MemoryGuard watches the process from a thread of its own. It closes the sockets and binds them
/// again to free what they hold.
class ServiceSockets {
 public:
  /// Binds the sockets.
  ///
  /// @param log  Refused peers, lists that cannot be read, sockets that were closed; called by
  ///             serve() and is_allowed() of the authenticator only.
  /// @throws InvalidArgument if an endpoint is not acceptable; Error if it cannot be bound or keys
  ///         cannot be read.
  ServiceSockets(const ServiceConfig& config, Log log);
  ~ServiceSockets();
  ServiceSockets(const ServiceSockets&) = delete;
  ServiceSockets& operator=(const ServiceSockets&) = delete;

  [[nodiscard]] RouterSocket& workers() { return *workers_; }
  [[nodiscard]] RouterSocket* clients() { return clients_.get(); }  ///< Null if there are none.

  /// Who may connect; null if there are no keys.
  [[nodiscard]] Authenticator* authenticator() { return authenticator_.get(); }

  [[nodiscard]] const Descriptors& descriptors() const { return descriptors_; }

  /// How often the sockets were closed and bound again to free memory or descriptors.
  [[nodiscard]] std::uint64_t num_resets() const { return num_resets_; }

  /// Until a message, a handshake or a wake() is there, or the time is over.
  void wait(std::chrono::milliseconds duration_max);
  /// Ends a wait(); from any thread.
  void wake() const { wake_.notify(); }
  /// Answers handshakes and logs what happened to the sockets. Never waits.
  void serve(TimePoint now);

 private:
  // Called in the guard's thread.
  void close();
  bool open();
  void note(Event event);
  void set_closing(bool is_closing);

  Log log_;
  wire::Wake wake_;
  std::unique_ptr<zmq::context_t> context_;
  std::unique_ptr<Authenticator> authenticator_;  ///< Made before any socket is bound.
  std::unique_ptr<RouterSocket> workers_;
  std::unique_ptr<RouterSocket> clients_;  ///< Null if there are no clients.
  std::mutex mutex_;                       ///< For what follows.
  std::condition_variable closed_;
  bool is_closing_ = false;
  std::vector<Event> notes_;
  std::atomic<std::uint64_t> num_resets_ = 0;
  Descriptors descriptors_;
  std::optional<MemoryGuard> guard_;  ///< Uses all the others: the last one.
};

}  // namespace proofmass::coordinator
