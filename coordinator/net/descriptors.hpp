#pragma once

#include <cstddef>
#include <cstdint>

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

/// Lets the process have as many open descriptors as the system allows: what shells and init
/// systems give by default is often 1024.
/// @return Their number.
std::uint64_t raise_descriptor_limit();

/// The lowest descriptor that is free: about the number of those that are open.
[[nodiscard]] int lowest_free_descriptor();

}  // namespace proofmass::coordinator
