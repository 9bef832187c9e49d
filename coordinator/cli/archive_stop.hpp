#pragma once

#include <functional>

#include "coordinator/archive/archive_error.hpp"

namespace proofmass::coordinator {

/// Does what reads a database and may take long; SIGINT and SIGTERM end it in order.
/// @return The ExitCode of `work`, or exit_interrupted.
[[nodiscard]] int run_until_stopped(const std::function<int(const IsStopped&)>& work);

}  // namespace proofmass::coordinator
