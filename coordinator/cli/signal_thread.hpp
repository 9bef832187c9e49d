#pragma once

#include <signal.h>

#include <thread>

namespace proofmass::coordinator {

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

  /// SIGINT and SIGTERM.
  [[nodiscard]] static sigset_t signals();

 private:
  sigset_t former_mask_{};
  std::jthread thread_;
};

}  // namespace proofmass::coordinator
