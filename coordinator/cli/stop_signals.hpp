#pragma once

#include <signal.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <thread>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/net/service.hpp"

namespace proofmass::coordinator {

/// What the first SIGTERM asks for; SIGINT and a second SIGTERM ask to stop now. With `drain`,
/// SIGHUP asks to leave the workers to the next coordinator, unless the process was started with
/// SIGHUP ignored.
enum class OnTerminate : std::uint8_t { stop_now, drain };

/// From now on these signals end no process: they set the request that is returned, which lives
/// as long as the process.
[[nodiscard]] const std::atomic<StopRequest>& catch_stop_signals(OnTerminate on_terminate);

/// Does what reads or makes a database and may take long; SIGINT and SIGTERM end it in order: what
/// they make it throw, an Interrupted or a StoreError, is no failure.
/// @return The ExitCode of `work`, or exit_interrupted.
[[nodiscard]] int run_until_stopped(const std::function<int(const IsStopped&)>& work);

/// While it lives, SIGINT and SIGTERM interrupt no call of the thread that made it, nor of any
/// thread that is started after it: a thread of its own runs their handlers. libzmq needs that: any
/// of its calls, also one that does not wait, fails with EINTR if a signal comes at the wrong
/// moment. Processes that are started meanwhile inherit the blocked signals.
class SignalThread {
 public:
  SignalThread();
  ~SignalThread();
  SignalThread(const SignalThread&) = delete;
  SignalThread& operator=(const SignalThread&) = delete;

  /// SIGINT, SIGTERM and SIGHUP.
  [[nodiscard]] static sigset_t signals();

 private:
  sigset_t former_mask_{};
  std::jthread thread_;
};

}  // namespace proofmass::coordinator
