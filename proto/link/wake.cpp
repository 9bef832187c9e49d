#include "proto/link/wake.hpp"

#include <fmt/format.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>

#include "core/error.hpp"

namespace proofmass::wire {

Wake::Wake() : descriptor_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (descriptor_ < 0) throw Error(fmt::format("eventfd: {}", std::strerror(errno)));
}

Wake::~Wake() { close(descriptor_); }

void Wake::notify() const {
  const std::uint64_t one = 1;
  // It fails only if the counter is full, and then the descriptor is readable already.
  [[maybe_unused]] const auto written = write(descriptor_, &one, sizeof one);
}

bool Wake::take() const {
  std::uint64_t count = 0;
  return read(descriptor_, &count, sizeof count) == sizeof count;
}

}  // namespace proofmass::wire
