#include "coordinator/cli/stop_signals.hpp"

#include <csignal>

#include "coordinator/cli/exit_code.hpp"
#include "proto/command_line/standard_error.hpp"

namespace proofmass::coordinator {
namespace {

// A signal handler can reach nothing but globals.
std::atomic<StopRequest> request = StopRequest::none;
std::atomic<StopRequest> request_of_first_terminate = StopRequest::now;
static_assert(std::atomic<StopRequest>::is_always_lock_free);

void on_signal(int signal) {
  const bool is_first_terminate = signal == SIGTERM && request == StopRequest::none;
  request = is_first_terminate ? request_of_first_terminate.load() : StopRequest::now;
}

}  // namespace

const std::atomic<StopRequest>& catch_stop_signals(OnTerminate on_terminate) {
  const bool drains = on_terminate == OnTerminate::drain;
  request_of_first_terminate = drains ? StopRequest::drain : StopRequest::now;
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  return request;
}

int run_until_stopped(const std::function<int(const IsStopped&)>& work) {
  const std::atomic<StopRequest>& stop = catch_stop_signals(OnTerminate::stop_now);
  try {
    return work([&stop] { return stop != StopRequest::none; });
  } catch (const Interrupted&) {
    wire::say("proofmass: interrupted\n");
    return exit_interrupted;
  }
}

}  // namespace proofmass::coordinator
