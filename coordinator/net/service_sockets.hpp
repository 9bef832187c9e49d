#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string_view>
#include <thread>
#include <vector>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/net/authentication/authenticator.hpp"
#include "coordinator/net/router_socket.hpp"
#include "coordinator/net/service.hpp"
#include "proto/link/socket.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

/// The descriptors that a service may have open. Each connection is one, and ZeroMQ 4.3.4 does not
/// limit connections: that of a TCP port tries again at once, for ever, when there is none left for
/// the next, and that of a local socket aborts the process (ipc_listener.cpp, accept()).
struct Descriptors {
  std::uint64_t limit = 0;  ///< Of the process.
  /// Workers for which there is room; further ones are rejected when they register.
  std::size_t num_workers_max = 0;
  /// When this one is the lowest that is free, peers have taken too many: the sockets are closed
  /// and bound again (see MemoryGuard).
  int alarm = 0;
};

/// Keeps an eighth of the descriptors, at most 64, for files, and as many for clients.
///
/// @param limit         What the process may have open.
/// @param num_reserved  Of those, for others than the service.
/// @param num_open      What it has open now, besides connections.
[[nodiscard]] Descriptors shared_out(std::uint64_t limit, std::uint64_t num_reserved, int num_open);

/// Descriptors that a campaign database takes while it is open: two for the file, and one each for
/// its write-ahead log, the memory that its users share and its lock.
inline constexpr std::uint64_t descriptors_per_campaign = 5;

/// Descriptors that the sockets take before a peer connects: 16, and a few more with keys.
inline constexpr std::uint64_t descriptors_of_sockets = 20;

/// Whether one more campaign database may be opened. Besides what shared_out() keeps for files and
/// clients, as many descriptors must be left for workers.
[[nodiscard]] bool has_room_for_campaign(std::uint64_t limit, std::uint64_t num_reserved,
                                         std::uint64_t num_open);

/// @param what  `campaign = NAME`, of which the error speaks.
/// @throws Error if the limit of this process leaves no room for it.
void require_room_for_campaign(std::string_view what, std::uint64_t num_reserved);

/// Lets the process have as many open descriptors as the system allows: what shells and init
/// systems give by default is often 1024.
/// @return Their number.
std::uint64_t raise_descriptor_limit();

/// The lowest descriptor that is free: about the number of those that are open.
[[nodiscard]] int lowest_free_descriptor();

/// Decides when the sockets of a process are closed to free the memory that they hold. A size is
/// that of the process's resident memory.
class MemoryBound {
 public:
  /// @param size_max  Of the process, bytes. The sockets are closed from three quarters of it on,
  ///                  so that what arrives meanwhile finds room.
  explicit MemoryBound(std::size_t size_max) : alarm_size_(size_max / 4 * 3), limit_(alarm_size_) {}

  /// True if the sockets are to be closed at this size. Where closing the sockets did not bring the
  /// process below three quarters of `size_max`, something else needs the memory, and the sockets
  /// are closed again only when the process has grown by a further quarter.
  [[nodiscard]] bool is_exceeded(std::size_t size);

  /// @param size  After the sockets were closed and memory was given back.
  /// @return True if the process is still too large, and was not before.
  [[nodiscard]] bool note_reset(std::size_t size);

  [[nodiscard]] std::size_t limit() const { return limit_; }  ///< Beyond which it is exceeded.

 private:
  std::size_t alarm_size_;
  std::size_t limit_;
  bool is_high_ = false;
};

/// Resident memory of this process. Keeps a file open, so that it works when the process has no
/// descriptor left.
class ResidentMemory {
 public:
  ResidentMemory();  ///< @throws Error if the system does not tell.

  [[nodiscard]] std::size_t size() const;  ///< Bytes.

 private:
  wire::Descriptor file_;
};

/// Watches the memory and the descriptors of this process 40 times a second, in a thread of its
/// own, and therefore also while the service's thread is busy or waits for a disk.
class MemoryGuard {
 public:
  /// What a guard does to sockets, in its own thread.
  struct Actions {
    std::function<void()> close;  ///< Frees all that the sockets hold; nothing is received then.
    std::function<bool()> open;   ///< False if the addresses are taken now: called again.
    /// Whether the peers have taken so many descriptors that the sockets are to be closed.
    std::function<bool()> lacks_descriptors;
    Log note;  ///< `sockets_reset`, `memory_high`, `sockets_unbound`.
  };

  MemoryGuard(std::size_t size_max, Actions actions);
  ~MemoryGuard();  ///< Waits for the thread.

 private:
  void watch();
  void reset(std::size_t size_before, std::string_view reason);
  void open();
  /// Size of the process once what the sockets held is free. Nothing comes in meanwhile.
  [[nodiscard]] std::size_t settled_size();
  void note(std::string_view kind, wire::Fields fields) const;
  /// Waits; true if the guard is ending.
  bool is_stopping_after(std::chrono::steady_clock::duration duration);

  ResidentMemory memory_;
  MemoryBound bound_;
  std::size_t size_max_;
  Actions actions_;
  bool is_open_ = true;
  std::mutex mutex_;  ///< For the end of the thread.
  std::condition_variable stopping_;
  bool is_stopping_ = false;
  std::thread thread_;  ///< Begins when all else is there.
};

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
