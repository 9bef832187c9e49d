#pragma once

#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>

namespace proofmass::coordinator {

/// How many connections a process may accept, so that descriptors remain for its files and for
/// clients when workers would take them all.
///
/// ZeroMQ 4.3.4 has no such limit, and its listeners behave badly when there is no descriptor left:
/// that of a local socket aborts the process (ipc_listener.cpp, accept()), and that of a TCP port
/// tries again at once, for ever. Therefore this library defines accept4(), which the dynamic
/// linker gives to ZeroMQ in place of the C library's. It closes a connection beyond the limit at
/// once; the peer tries again later.
struct ConnectionLimit {
  /// A connection whose descriptor has this number or a higher one is closed. The system gives each
  /// the lowest number that is free, so that about as many descriptors are open then.
  int workers_end = std::numeric_limits<int>::max();
  int clients_end = std::numeric_limits<int>::max();  ///< The same for `clients_endpoint`.
  std::string clients_endpoint = {};                  ///< As bound; empty without clients.
  /// Connections of workers for which there is room at the start.
  int num_workers_max = 0;
};

/// Lets the process have as many open descriptors as the system allows: each connection is one, and
/// what shells and init systems give by default is often 1024.
/// @return Their number.
std::uint64_t raise_descriptor_limit();

/// Keeps an eighth of the descriptors, at most 64, for files, and as many for clients.
///
/// @param descriptors_max  What the process may have open.
/// @param num_open         What it has open now, besides connections.
[[nodiscard]] ConnectionLimit connection_limit(std::uint64_t descriptors_max, int num_open,
                                               const std::string& clients_endpoint);

/// The lowest descriptor that is free: about the number of those that are open.
[[nodiscard]] int lowest_free_descriptor();

/// Holds from now on for all connections that this process accepts.
void limit_connections(const ConnectionLimit& limit);

/// Connections that were closed because of the limit, since the process began.
[[nodiscard]] std::uint64_t num_connections_refused();

/// Tells when connections begin to be refused, and not again before a pause without any.
class RefusedConnections {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  /// @param num_refused  Since the process began.
  /// @return True if that is news.
  [[nodiscard]] bool is_news(std::uint64_t num_refused, TimePoint now);

 private:
  std::uint64_t num_refused_ = 0;
  std::optional<TimePoint> refused_at_;
};

}  // namespace proofmass::coordinator
