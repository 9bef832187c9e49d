#include "coordinator/cli/archive_stop.hpp"

#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "proto/command_line/standard_error.hpp"

namespace proofmass::coordinator {

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
