#include "worker/supervision/supervisor.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <new>
#include <utility>

#include "core/error.hpp"
#include "proto/link/machine.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::worker {
namespace {

using Clock = std::chrono::steady_clock;

sigset_t supervised_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : {SIGCHLD, SIGCONT, handed_on_signal()}) sigaddset(&set, signal);
  for (const int signal : end_signals()) sigaddset(&set, signal);
  return set;
}

bool asks_to_end(int signal) { return signal == SIGTERM || signal == SIGINT || signal == SIGHUP; }

/// A flag that a child shares with the process that made it.
class SharedFlag {
 public:
  SharedFlag() {
    void* const place = mmap(nullptr, sizeof(std::atomic<bool>), PROT_READ | PROT_WRITE,
                             MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (place == MAP_FAILED) throw Error(fmt::format("memory ({})", std::strerror(errno)));
    flag_ = new (place) std::atomic<bool>(false);
  }
  ~SharedFlag() { munmap(flag_, sizeof *flag_); }
  SharedFlag(const SharedFlag&) = delete;
  SharedFlag& operator=(const SharedFlag&) = delete;

  std::atomic<bool>& operator*() const { return *flag_; }

 private:
  std::atomic<bool>* flag_ = nullptr;
};
static_assert(std::atomic<bool>::is_always_lock_free);

timespec timespec_of(Clock::duration time) {
  const auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(time).count();
  return {.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000};
}

wire::Fields how_ended(int status) {
  if (!WIFSIGNALED(status)) {
    return {{"exit_code", static_cast<unsigned>(WEXITSTATUS(status))},
            wire::Field::remark("(a computation hangs)")};
  }
  const int signal = WTERMSIG(status);
  return {{"signal", static_cast<unsigned>(signal)},
          wire::Field::remark(fmt::format("({})", strsignal(signal)))};
}

class Supervisor {
 public:
  Supervisor(const std::function<int(const ChildStart&)>& work, const wire::Log& log,
             const RestartConfig& config)
      : work_(work), log_(log), policy_(config), config_(config), signals_(supervised_signals()) {
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  }

  int run() {
    std::optional<proto::FormerSession> former;
    while (true) {
      *is_registered_ = false;
      const ChildStart start{.session = wire::SessionId{wire::random_number()},
                             .former = former,
                             .note_registered = [this] { *is_registered_ = true; }};
      const std::uint64_t num_killed_before = wire::num_oom_kills();
      const pid_t child = start_child(start);
      const int status = wait_for(child);
      if (WIFEXITED(status) && WEXITSTATUS(status) != exit_hung) return WEXITSTATUS(status);
      if (num_requests_ > 0) return exit_code_of(status);
      // A session that nobody knows leaves no runs, but it may not have told of the one before.
      if (*is_registered_) {
        former = former_session(start.session, status, wire::num_oom_kills() > num_killed_before);
      }
      if (!wait_before_restart(status)) return 0;
    }
  }

 private:
  pid_t start_child(const ChildStart& start) {
    std::fflush(nullptr);
    const pid_t supervisor = getpid();
    const pid_t child = fork();
    if (child < 0) throw Error(fmt::format("worker process = none ({})", std::strerror(errno)));
    if (child > 0) return child;
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != supervisor) _exit(0);  // It ended before it could be watched.
    sigset_t children;
    sigemptyset(&children);
    sigaddset(&children, SIGCHLD);
    pthread_sigmask(SIG_UNBLOCK, &children, nullptr);
    const int exit_code = work_(start);
    std::fflush(nullptr);
    _exit(exit_code);  // The supervisor ends the program; this is a part of it.
  }

  /// Hands requests on until the child has ended, and returns how it did. When this process is
  /// continued (SIGCONT) or asked to end, the child is continued, too: a child that is forked while
  /// its process group is stopped and continued may stay stopped, and then it could not even end.
  int wait_for(pid_t child) {
    std::optional<int> status;
    while (!(status = wire::status_if_ended(child))) {
      const int signal = sigwaitinfo(&signals_, nullptr);
      if (asks_to_end(signal)) {
        ++num_requests_;
        sigqueue(child, handed_on_signal(), {.sival_int = num_requests_});
        kill(child, SIGCONT);
      }
      if (signal == SIGCONT) kill(child, SIGCONT);
    }
    return *status;
  }

  static int exit_code_of(int status) {
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

  /// What the next child tells of one that a signal ended, so that nobody waits for its runs.
  static std::optional<proto::FormerSession> former_session(wire::SessionId session, int status,
                                                            bool is_memory_short) {
    const wire::LossReason reason = wire::reason_of_end(status, is_memory_short);
    if (reason == wire::LossReason::failed) return std::nullopt;
    proto::FormerSession former;
    former.set_session(session.value);
    former.set_reason(wire::message_value(reason));
    former.set_signal(static_cast<std::uint32_t>(WTERMSIG(status)));
    return former;
  }

  /// False if it was asked to end meanwhile.
  bool wait_before_restart(int status) {
    wire::Fields fields = how_ended(status);
    const auto delay = policy_.on_crash(Clock::now());
    if (!delay) {
      throw Error(fmt::format(
          "crashes = {} (must be fewer within {} s); the last by {}", config_.num_crashes_max,
          std::chrono::duration_cast<std::chrono::seconds>(config_.window).count(),
          to_text(fields)));
    }
    const double delay_s = std::chrono::duration<double>(*delay).count();
    fields.emplace_back("restart_in_s", std::round(10.0 * delay_s) / 10.0);
    log_(wire::Event::error("worker_crashed", std::move(fields)));
    return !is_asked_to_end_within(*delay);
  }

  bool is_asked_to_end_within(Clock::duration time) {
    const Clock::time_point until = Clock::now() + time;
    while (true) {
      const timespec left = timespec_of(std::max(Clock::duration::zero(), until - Clock::now()));
      const int signal = sigtimedwait(&signals_, nullptr, &left);
      if (asks_to_end(signal)) return true;
      if (signal < 0 && errno == EAGAIN) return false;
    }
  }

  const std::function<int(const ChildStart&)>& work_;
  const wire::Log& log_;
  RestartPolicy policy_;
  RestartConfig config_;
  sigset_t signals_;
  SharedFlag is_registered_;  ///< Of the child that runs.
  int num_requests_ = 0;
};

}  // namespace

std::optional<RestartConfig::Duration> RestartPolicy::on_crash(
    std::chrono::steady_clock::time_point now) {
  while (!crashes_.empty() && now - crashes_.front() > config_.window) crashes_.pop_front();
  crashes_.push_back(now);
  if (crashes_.size() >= config_.num_crashes_max) return std::nullopt;
  RestartConfig::Duration delay = config_.delay;
  for (std::size_t i = 1; i < crashes_.size() && delay < config_.delay_max; ++i) delay *= 2;
  return std::min(delay, config_.delay_max);
}

std::vector<int> end_signals() {
  std::vector<int> signals{SIGTERM, SIGINT};
  struct sigaction now {};
  sigaction(SIGHUP, nullptr, &now);
  if (now.sa_handler != SIG_IGN) signals.push_back(SIGHUP);
  return signals;
}

int handed_on_signal() { return SIGRTMIN; }

int supervise(const std::function<int(const ChildStart&)>& work, const wire::Log& log,
              const RestartConfig& config) {
  return Supervisor(work, log, config).run();
}

}  // namespace proofmass::worker
