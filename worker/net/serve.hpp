#pragma once

#include <cstdint>
#include <string>

#include "proto/wire/messages.hpp"
#include "worker/execution/executor.hpp"
#include "worker/net/conversation.hpp"

namespace proofmass::worker {

/// Which signals ask a worker to leave.
enum class Signals : std::uint8_t {
  terminate_and_interrupt,  ///< SIGTERM and SIGINT.
  terminate,                ///< SIGTERM; whoever started the worker deals with SIGINT.
};

/// Computes runs for the coordinator at the endpoint until told to stop. Blocks the signals for the
/// process; to be called before any other thread is made.
///
/// @param endpoint  check_endpoint() holds.
/// @throws Error if the socket cannot be made.
[[nodiscard]] Ending serve(const std::string& endpoint, const wire::Hello& hello, Prepare prepare,
                           const ExecutorConfig& config, Signals signals);

}  // namespace proofmass::worker
