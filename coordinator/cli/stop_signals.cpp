#include "coordinator/cli/stop_signals.hpp"

#include <condition_variable>
#include <csignal>
#include <mutex>
#include <stop_token>

#include "coordinator/cli/program.hpp"
#include "coordinator/store/records.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

// A signal handler can reach nothing but globals.
std::atomic<StopRequest> request = StopRequest::none;
std::atomic<StopRequest> request_of_first_terminate = StopRequest::now;
static_assert(std::atomic<StopRequest>::is_always_lock_free);

void on_signal(int signal) {
  const bool is_first = request == StopRequest::none;
  if (is_first && signal == SIGTERM) {
    request = request_of_first_terminate.load();
  } else if (signal != SIGHUP) {
    request = StopRequest::now;
  } else if (is_first) {
    request = StopRequest::leave;
  }
}

void run_handlers(const std::stop_token& stop) {
  const sigset_t signals = SignalThread::signals();
  pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
  std::mutex mutex;
  std::unique_lock lock(mutex);
  std::condition_variable_any().wait(lock, stop, [] { return false; });
}

}  // namespace

const std::atomic<StopRequest>& catch_stop_signals(OnTerminate on_terminate) {
  const bool drains = on_terminate == OnTerminate::drain;
  request_of_first_terminate = drains ? StopRequest::drain : StopRequest::now;
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  // `nohup` ignores it, and that must stay so.
  const bool leaves = drains && std::signal(SIGHUP, SIG_IGN) != SIG_IGN;
  if (leaves) std::signal(SIGHUP, on_signal);
  return request;
}

int run_until_stopped(const std::function<int(const IsStopped&)>& work) {
  const std::atomic<StopRequest>& stop = catch_stop_signals(OnTerminate::stop_now);
  try {
    return work([&stop] { return stop != StopRequest::none; });
  } catch (const Interrupted&) {
  } catch (const StoreError&) {
    // A database that is being made says so of whatever ends its making.
    if (stop == StopRequest::none) throw;
  }
  wire::say("proofmass: interrupted\n");
  return exit_interrupted;
}

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
  sigaddset(&set, SIGHUP);
  return set;
}

}  // namespace proofmass::coordinator
