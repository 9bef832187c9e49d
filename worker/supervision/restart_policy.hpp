#pragma once

#include <chrono>
#include <deque>
#include <optional>

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

}  // namespace proofmass::worker
