#include "coordinator/net/descriptors.hpp"

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <limits>

#include "core/error.hpp"

namespace proofmass::coordinator {

Descriptors shared_out(std::uint64_t limit, std::uint64_t num_reserved, int num_open) {
  constexpr std::uint64_t share_max = 64;
  const std::uint64_t left = limit - std::min(num_reserved, limit);
  const std::uint64_t share = std::min(left / 8, share_max);
  const std::uint64_t taken = 2 * share + static_cast<std::uint64_t>(num_open);
  const std::uint64_t alarm =
      std::min<std::uint64_t>(left - share, std::numeric_limits<int>::max());
  return {.limit = limit,
          .num_workers_max = left - std::min(taken, left),
          .alarm = static_cast<int>(alarm)};
}

std::uint64_t raise_descriptor_limit() {
  rlimit limit{};
  PROOFMASS_EXPECT(getrlimit(RLIMIT_NOFILE, &limit) == 0);
  const rlim_t before = limit.rlim_cur;
  limit.rlim_cur = limit.rlim_max;
  // Where even this is forbidden, the service has what it was given.
  return setrlimit(RLIMIT_NOFILE, &limit) == 0 ? limit.rlim_cur : before;
}

int lowest_free_descriptor() {
  const int descriptor = open("/dev/null", O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return std::numeric_limits<int>::max();
  close(descriptor);
  return descriptor;
}

}  // namespace proofmass::coordinator
