#include "coordinator/cli/signal_thread.hpp"

#include <condition_variable>
#include <mutex>
#include <stop_token>

namespace proofmass::coordinator {
namespace {

void run_handlers(const std::stop_token& stop) {
  const sigset_t signals = SignalThread::signals();
  pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
  std::mutex mutex;
  std::unique_lock lock(mutex);
  std::condition_variable_any().wait(lock, stop, [] { return false; });
}

}  // namespace

SignalThread::SignalThread() {
  const sigset_t blocked = signals();
  pthread_sigmask(SIG_BLOCK, &blocked, &former_mask_);
  thread_ = std::jthread(run_handlers);
}

SignalThread::~SignalThread() {
  thread_.request_stop();
  thread_.join();
  pthread_sigmask(SIG_SETMASK, &former_mask_, nullptr);
}

sigset_t SignalThread::signals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  return set;
}

}  // namespace proofmass::coordinator
