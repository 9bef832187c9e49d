#include "coordinator/query/child_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <exception>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

// Sanitizers reserve terabytes of address space.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool has_memory_limit = false;
#else
constexpr bool has_memory_limit = true;
#endif

bool lower_limit(__rlimit_resource resource, std::uint64_t soft, std::uint64_t hard) {
  rlimit limit{};
  if (getrlimit(resource, &limit) != 0) return false;
  limit.rlim_max = std::min<rlim_t>(limit.rlim_max, hard);
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, soft);
  return setrlimit(resource, &limit) == 0;
}

bool apply(const ChildLimits& limits) {
  if (has_memory_limit && !lower_limit(RLIMIT_AS, limits.memory_size_max, limits.memory_size_max)) {
    return false;
  }
  return lower_limit(RLIMIT_CPU, limits.compute_s_max, limits.compute_s_max + 1);
}

// Without its limits the child does nothing at all.
[[noreturn]] void be_child(pid_t parent, const ChildLimits& limits,
                           const std::function<void(int)>& work, int pipe) {
  const bool dies_with_parent =
      prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && getppid() == parent;  // It may have died before.
  if (!dies_with_parent || !apply(limits)) _exit(127);
  try {
    work(pipe);
  } catch (...) {
    _exit(126);
  }
  _exit(0);
}

}  // namespace

ChildProcess::ChildProcess(const ChildLimits& limits, const std::function<void(int)>& work) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) {
    throw Error(fmt::format("pipe: {}", std::strerror(errno)));
  }
  const pid_t parent = getpid();
  id_ = fork();
  if (id_ == 0) {
    close(ends[0]);
    be_child(parent, limits, work, ends[1]);
  }
  const int error = errno;
  close(ends[1]);
  pipe_ = ends[0];
  if (id_ > 0) return;
  close(pipe_);
  throw Error(fmt::format("fork: {}", std::strerror(error)));
}

ChildProcess::~ChildProcess() {
  close(pipe_);
  if (id_ == 0) return;
  kill(id_, SIGKILL);
  (void)wait();
}

void ChildProcess::signal(int number) const {
  if (id_ != 0) kill(id_, number);
}

int ChildProcess::wait() {
  int status = 0;
  while (waitpid(id_, &status, 0) < 0 && errno == EINTR) {
  }
  id_ = 0;
  return status;
}

std::string end_text(int status) {
  if (!WIFSIGNALED(status)) return fmt::format("exit code {}", WEXITSTATUS(status));
  const int number = WTERMSIG(status);
  return fmt::format("killed by signal {} ({})", number, strsignal(number));
}

}  // namespace proofmass::coordinator
