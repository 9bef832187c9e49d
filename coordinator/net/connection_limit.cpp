#include "coordinator/net/connection_limit.hpp"

#include <fcntl.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <limits>
#include <mutex>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::uint64_t reserve_max = 64;
// Peers that are refused try again within half a minute.
constexpr std::chrono::minutes pause_before_news(5);

/// Of the process: what the library calls has no other way to learn it.
struct LimitInForce {
  std::atomic<int> lowest_end{std::numeric_limits<int>::max()};
  std::atomic<std::uint64_t> num_refused{0};
  std::mutex mutex;  ///< For what follows.
  ConnectionLimit limit;
};

LimitInForce& in_force() {
  static LimitInForce limit;
  return limit;
}

/// True if a socket listens at the endpoint, as far as the port or the path tells.
bool listens_at(int listener, const std::string& endpoint) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  if (getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size) != 0) return false;
  if (address.ss_family == AF_UNIX) {
    sockaddr_un local{};
    std::memcpy(&local, &address, sizeof local);
    return endpoint == std::string("ipc://") + local.sun_path;
  }
  sockaddr_in6 tcp{};  // The port of IPv4 is at the same place.
  std::memcpy(&tcp, &address, sizeof tcp);
  return endpoint.ends_with(":" + std::to_string(ntohs(tcp.sin6_port)));
}

bool is_beyond(int descriptor, int listener) {
  LimitInForce& force = in_force();
  if (descriptor < force.lowest_end) return false;
  const std::lock_guard lock(force.mutex);
  const bool is_client = listens_at(listener, force.limit.clients_endpoint);
  return descriptor >= (is_client ? force.limit.clients_end : force.limit.workers_end);
}

/// As accept4(2), but a connection that is beyond the limit, or finds no descriptor, is one that
/// its peer has aborted: what every listener of ZeroMQ takes calmly.
int accept_within_limit(int listener, sockaddr* address, socklen_t* size, int flags) {
  const auto accepted = static_cast<int>(syscall(SYS_accept4, listener, address, size, flags));
  const bool has_none = accepted < 0 && errno == EMFILE;
  if (!has_none && (accepted < 0 || !is_beyond(accepted, listener))) return accepted;
  if (accepted >= 0) close(accepted);
  ++in_force().num_refused;
  errno = ECONNABORTED;
  return -1;
}

}  // namespace

std::uint64_t raise_descriptor_limit() {
  rlimit limit{};
  PROOFMASS_EXPECT(getrlimit(RLIMIT_NOFILE, &limit) == 0);
  const rlim_t before = limit.rlim_cur;
  limit.rlim_cur = limit.rlim_max;
  // Where even this is forbidden, the service has what it was given.
  return setrlimit(RLIMIT_NOFILE, &limit) == 0 ? limit.rlim_cur : before;
}

ConnectionLimit connection_limit(std::uint64_t descriptors_max, int num_open,
                                 const std::string& clients_endpoint) {
  const std::uint64_t numbers_max = std::numeric_limits<int>::max();
  const auto end = static_cast<int>(std::min(descriptors_max, numbers_max));
  const auto reserve = static_cast<int>(std::min(descriptors_max / 8, reserve_max));
  return {.workers_end = end - 2 * reserve,
          .clients_end = end - reserve,
          .clients_endpoint = clients_endpoint,
          .num_workers_max = std::max(0, end - 2 * reserve - num_open)};
}

int lowest_free_descriptor() {
  const int descriptor = open("/dev/null", O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) throw Error(std::string("/dev/null: ") + std::strerror(errno));
  close(descriptor);
  return descriptor;
}

void limit_connections(const ConnectionLimit& limit) {
  LimitInForce& force = in_force();
  const std::lock_guard lock(force.mutex);
  force.limit = limit;
  force.lowest_end = std::min(limit.workers_end, limit.clients_end);
}

std::uint64_t num_connections_refused() { return in_force().num_refused; }

bool RefusedConnections::is_news(std::uint64_t num_refused, TimePoint now) {
  if (num_refused == num_refused_) return false;
  num_refused_ = num_refused;
  const bool is_news = !refused_at_ || now - *refused_at_ >= pause_before_news;
  refused_at_ = now;
  return is_news;
}

}  // namespace proofmass::coordinator

/// In place of the C library's; see ConnectionLimit.
extern "C" __attribute__((visibility("default"))) int accept4(int listener,
                                                              sockaddr* __restrict address,
                                                              socklen_t* __restrict size,
                                                              int flags) {
  return proofmass::coordinator::accept_within_limit(listener, address, size, flags);
}
