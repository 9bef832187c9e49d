#pragma once

#include <functional>
#include <optional>

#include "proto/text/event.hpp"
#include "proto/wire/messages.hpp"
#include "worker/supervision/restart_policy.hpp"

namespace proofmass::worker {

/// What a child process begins with.
struct ChildStart {
  wire::SessionId session;
  std::optional<wire::FormerSession> former;  ///< How the child before it crashed, if it did.
};

/// Signal by which a supervisor hands on to its child that it was asked to end; the value that
/// comes with it says how often. The signals themselves may reach both processes, or one.
[[nodiscard]] int handed_on_signal();

/// Exit code of a child that had to leave a computation that hangs: it is started again.
inline constexpr int exit_hung = 3;

/// A random number, not 0.
[[nodiscard]] wire::SessionId random_session();

/// Runs the work in a child process, and again when that crashes or hangs. To be called before the
/// process has other threads or sockets.
///
/// SIGTERM and SIGINT are handed on to the child. In it they are blocked, as is handed_on_signal();
/// it gets SIGTERM if the supervisor ends.
///
/// @param work  Called in the child; must not throw. Its value is the child's exit code.
/// @param log   Told when a child has crashed.
/// @return The exit code of the last child.
/// @throws Error if no child can be made, or if it crashes too often.
[[nodiscard]] int supervise(const std::function<int(const ChildStart&)>& work, const wire::Log& log,
                            const RestartConfig& config = {});

}  // namespace proofmass::worker
