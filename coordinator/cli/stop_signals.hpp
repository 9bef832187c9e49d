#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/net/service.hpp"

namespace proofmass::coordinator {

/// What SIGTERM asks for; SIGINT, and any second signal, ask to stop now.
enum class OnTerminate : std::uint8_t { stop_now, drain };

/// From now on SIGINT and SIGTERM end no process: they set the request that is returned, which
/// lives as long as the process.
[[nodiscard]] const std::atomic<StopRequest>& catch_stop_signals(OnTerminate on_terminate);

/// Does what reads a database and may take long; SIGINT and SIGTERM end it in order.
/// @return The ExitCode of `work`, or exit_interrupted.
[[nodiscard]] int run_until_stopped(const std::function<int(const IsStopped&)>& work);

}  // namespace proofmass::coordinator
