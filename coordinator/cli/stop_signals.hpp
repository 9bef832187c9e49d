#pragma once

#include <atomic>
#include <cstdint>

#include "coordinator/net/service.hpp"

namespace proofmass::coordinator {

/// What SIGTERM asks for; SIGINT, and any second signal, ask to stop now.
enum class OnTerminate : std::uint8_t { stop_now, drain };

/// From now on SIGINT and SIGTERM end no process: they set the request that is returned, which
/// lives as long as the process.
[[nodiscard]] const std::atomic<StopRequest>& catch_stop_signals(OnTerminate on_terminate);

}  // namespace proofmass::coordinator
