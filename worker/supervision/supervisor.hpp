#pragma once

#include <chrono>
#include <deque>
#include <functional>
#include <optional>
#include <vector>

#include "proto/proofmass.pb.h"
#include "proto/text/event.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::worker {

/// Times between a crash and the next start.
struct RestartConfig {
  using Duration = std::chrono::steady_clock::duration;

  Duration delay = std::chrono::seconds(1);  ///< After the first crash; doubles with each other.
  /// Half of what a coordinator waits for a silent worker: the next process says in time whom the
  /// crash was with; told later, it would count against nobody.
  Duration delay_max = std::chrono::seconds(30);
  std::size_t num_crashes_max = 10;            ///< Within the window: then it is given up.
  Duration window = std::chrono::minutes(10);  ///< Older crashes do not count any more.
};

/// Says whether and when a process that crashed is started again.
class RestartPolicy {
 public:
  explicit RestartPolicy(const RestartConfig& config = {}) : config_(config) {}

  /// How long to wait; nothing if it crashes too often.
  /// @param now  Never earlier than in the call before.
  [[nodiscard]] std::optional<RestartConfig::Duration> on_crash(
      std::chrono::steady_clock::time_point now);

 private:
  RestartConfig config_;
  std::deque<std::chrono::steady_clock::time_point> crashes_;
};

/// What a child process begins with.
struct ChildStart {
  wire::SessionId session;
  /// Of the last child before it that registered, if a signal ended it and nobody was told yet.
  std::optional<proto::FormerSession> former;
  /// To be called once a coordinator knows the session and has been told of the former one.
  std::function<void()> note_registered = [] {};
};

/// The signals that ask a worker to end: SIGTERM, SIGINT, and SIGHUP unless it is ignored, as
/// `nohup` has it.
[[nodiscard]] std::vector<int> end_signals();

/// Signal by which a supervisor hands on to its child that it was asked to end; the value that
/// comes with it says how often. The signals themselves may reach both processes, or one.
[[nodiscard]] int handed_on_signal();

/// Exit code of a child that had to leave a computation that hangs: it is started again.
inline constexpr int exit_hung = 3;

/// Runs the work in a child process, and again when that crashes or hangs. To be called before the
/// process has other threads or sockets.
///
/// end_signals() are handed on to the child. In it they are blocked, as is handed_on_signal(); it
/// gets SIGTERM if the supervisor ends.
///
/// @param work  Called in the child; must not throw. Its value is the child's exit code.
/// @param log   Told when a child has crashed.
/// @return The exit code of the last child.
/// @throws Error if no child can be made, or if it crashes too often.
[[nodiscard]] int supervise(const std::function<int(const ChildStart&)>& work, const wire::Log& log,
                            const RestartConfig& config = {});

}  // namespace proofmass::worker
