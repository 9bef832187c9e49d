#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace proofmass::wire {

/// The init system that started this process, as systemd's sd_notify(3) describes it: it is
/// told when the service is ready, that it lives, and what it does. Without one, nothing happens.
class InitSystem {
 public:
  /// From NOTIFY_SOCKET and WATCHDOG_USEC.
  [[nodiscard]] static InitSystem from_environment();

  /// @param socket    Path, or `@NAME` of an abstract socket; empty if there is no init system.
  /// @param watchdog  It ends a process that says nothing for this long.
  InitSystem(std::string socket, std::optional<std::chrono::microseconds> watchdog);

  /// Sends lines such as `READY=1`, `STOPPING=1` or `STATUS=text`. What cannot be sent is lost.
  void notify(std::string_view lines) const;

  /// How often `WATCHDOG=1` must be sent, with a margin; nothing if nobody waits for it.
  [[nodiscard]] std::optional<std::chrono::microseconds> watchdog_interval() const;

 private:
  std::string socket_;
  std::optional<std::chrono::microseconds> watchdog_;
};

/// Tells the init system how a service is.
class ServiceNotices {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  explicit ServiceNotices(InitSystem init_system = InitSystem::from_environment());

  /// The service is ready. Only the first call says so.
  void ready();
  /// The service is ending. Only the first call says so.
  void stopping();
  /// Says that the service lives, as often as the init system wants to hear it, and every 5 s what
  /// it does. To be called several times a second.
  void on_tick(TimePoint now, const std::function<std::string()>& status);

 private:
  InitSystem init_system_;
  bool is_ready_ = false;
  bool is_stopping_ = false;
  TimePoint watchdog_at_ = TimePoint::min();
  TimePoint status_at_ = TimePoint::min();
};

}  // namespace proofmass::wire
