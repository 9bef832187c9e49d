#include "coordinator/net/memory_guard.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <utility>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

using Clock = std::chrono::steady_clock;

// One connection on the same machine can bring in about a gigabyte a second.
constexpr std::chrono::milliseconds look_interval(25);
// ZeroMQ frees what a closed socket held in threads of its own: it is done when nothing more comes.
constexpr std::chrono::milliseconds settled_after(100);
constexpr std::chrono::seconds settle_time_max(3);
// Peers that do have keys get in again meanwhile, and others are cut off.
constexpr std::chrono::seconds descriptors_pause(5);

std::size_t mebibytes(std::size_t size) { return size >> 20; }

}  // namespace

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
  const wire::Descriptor lowest(open("/dev/null", O_RDONLY | O_CLOEXEC));
  return lowest.number() < 0 ? std::numeric_limits<int>::max() : lowest.number();
}

bool MemoryBound::is_exceeded(std::size_t size) {
  if (size <= alarm_size_) {
    limit_ = alarm_size_;
    is_high_ = false;
  }
  return size > limit_;
}

bool MemoryBound::note_reset(std::size_t size) {
  if (size <= alarm_size_) return false;
  limit_ = size + size / 4;
  return !std::exchange(is_high_, true);
}

ResidentMemory::ResidentMemory() : file_(open("/proc/self/statm", O_RDONLY | O_CLOEXEC)) {
  if (file_.number() < 0) throw Error(fmt::format("/proc/self/statm: {}", std::strerror(errno)));
}

std::size_t ResidentMemory::size() const {
  // In pages: the size of the address space, what of it is resident.
  std::array<char, 128> text{};
  const ssize_t length = pread(file_.number(), text.data(), text.size() - 1, 0);
  PROOFMASS_EXPECT(length > 0);
  char* after_first = nullptr;
  (void)std::strtoull(text.data(), &after_first, 10);
  return std::strtoull(after_first, nullptr, 10) * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

MemoryGuard::MemoryGuard(std::size_t size_max, Actions actions)
    : bound_(size_max),
      size_max_(size_max),
      actions_(std::move(actions)),
      thread_([this] { watch(); }) {}

MemoryGuard::~MemoryGuard() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  stopping_.notify_all();
  thread_.join();
}

void MemoryGuard::watch() {
  Clock::time_point descriptors_at{};
  while (!is_stopping_after(look_interval)) {
    if (!is_open_) open();
    const std::size_t size = memory_.size();
    if (bound_.is_exceeded(size)) reset(size, "(peers connect anew)");
    if (Clock::now() < descriptors_at || !actions_.lacks_descriptors()) continue;
    reset(size, "(descriptors were lacking; peers connect anew)");
    descriptors_at = Clock::now() + descriptors_pause;
  }
}

void MemoryGuard::reset(std::size_t size_before, std::string_view reason) {
  actions_.close();
  const std::size_t size = settled_size();
  is_open_ = actions_.open();
  const bool is_news = bound_.note_reset(size);
  note("sockets_reset", {{"resident_mib", mebibytes(size_before)},
                         {"left_mib", mebibytes(size)},
                         {"memory_max_mib", mebibytes(size_max_)},
                         Field::remark(std::string(reason))});
  if (is_news) {
    note("memory_high", {{"resident_mib", mebibytes(size)},
                         {"memory_max_mib", mebibytes(size_max_)},
                         Field::remark(fmt::format("(not held by sockets; next reset at {} MiB)",
                                                   mebibytes(bound_.limit())))});
  }
  if (!is_open_) {
    note("sockets_unbound", {Field::remark("an address is taken; tried again until it is free")});
  }
}

void MemoryGuard::open() {
  is_open_ = actions_.open();
  if (is_open_) note("sockets_bound", {});
}

std::size_t MemoryGuard::settled_size() {
  const auto begin = Clock::now();
  auto shrunk_at = begin;
  std::size_t smallest = memory_.size();
  for (;;) {
    malloc_trim(0);
    const std::size_t size = memory_.size();
    const auto now = Clock::now();
    if (size < smallest) shrunk_at = now;
    smallest = std::min(smallest, size);
    const bool is_settled = now - shrunk_at > settled_after || now - begin > settle_time_max;
    if (is_settled || is_stopping_after(look_interval)) return size;
  }
}

void MemoryGuard::note(std::string_view kind, wire::Fields fields) const {
  actions_.note({.severity = kind == "sockets_unbound" ? Severity::error : Severity::warning,
                 .kind = kind,
                 .fields = std::move(fields)});
}

bool MemoryGuard::is_stopping_after(Clock::duration duration) {
  std::unique_lock lock(mutex_);
  return stopping_.wait_for(lock, duration, [this] { return is_stopping_; });
}

}  // namespace proofmass::coordinator
