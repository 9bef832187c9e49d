#include "proto/link/surroundings.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <latch>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include "core/error.hpp"

namespace proofmass::wire {
namespace {

// Opened the other way round: reading and writing fail as on a closed descriptor.
void occupy_standard_descriptors() {
  for (int descriptor = 0; descriptor < 3; ++descriptor) {
    if (::fcntl(descriptor, F_GETFD) >= 0) continue;
    if (::open("/dev/null", descriptor == 0 ? O_WRONLY : O_RDONLY) == descriptor) continue;
    throw Error(fmt::format("descriptor = {} (is closed, and /dev/null cannot take its place: {})",
                            descriptor, std::strerror(errno)));
  }
}

void settle_signals() {
  sigset_t none;
  sigemptyset(&none);
  ::pthread_sigmask(SIG_SETMASK, &none, nullptr);
  (void)std::signal(SIGCHLD, SIG_DFL);
  (void)std::signal(SIGXFSZ, SIG_IGN);
}

struct Limit {
  int resource;
  std::string_view name;
  rlim_t least, usual;
  std::string_view remedy;
};

// Half of that stack is too little for a batch; ZeroMQ aborts where it finds no descriptor.
constexpr Limit stack_size{RLIMIT_STACK, "stack in bytes", 256 << 10, 8 << 20, "ulimit -s"};
constexpr Limit num_descriptors{RLIMIT_NOFILE, "descriptors", 48, 1024, "ulimit -n"};

/// Raises a limit that is below the usual, as far as this user may.
void settle(const Limit& limit) {
  rlimit now{};
  if (::getrlimit(limit.resource, &now) != 0 || now.rlim_cur >= limit.usual) return;
  now.rlim_cur = std::min(now.rlim_max, limit.usual);
  if (::setrlimit(limit.resource, &now) == 0 && now.rlim_cur >= limit.least) return;
  throw Error(fmt::format("{} = {} (must be at least {}; raise `{}`)", limit.name, now.rlim_cur,
                          limit.least, limit.remedy));
}

// Stacks of other threads are as large as the limit was when the program began.
void settle_stacks() {
  settle(stack_size);
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, stack_size.usual);
  pthread_setattr_default_np(&attributes);
  pthread_attr_destroy(&attributes);
}

}  // namespace

void settle_surroundings() {
  occupy_standard_descriptors();
  settle_signals();
  settle_stacks();
  settle(num_descriptors);
}

void require_threads(int count) {
  std::latch end(1);
  std::vector<std::jthread> threads;
  int error = 0;
  try {
    for (int i = 0; i < count; ++i) threads.emplace_back([&end] { end.wait(); });
  } catch (const std::system_error& failure) {
    error = failure.code().value();
  }
  end.count_down();
  if (error == 0) return;
  throw Error(
      fmt::format("threads = {} (must be at least {}: {}; raise `ulimit -u`, or the limit "
                  "of the service or container)",
                  threads.size(), count, std::strerror(error)));
}

void ignore_broken_pipes() { (void)std::signal(SIGPIPE, SIG_IGN); }

}  // namespace proofmass::wire
