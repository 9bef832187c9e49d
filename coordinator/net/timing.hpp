#pragma once

#include <chrono>
#include <cstdint>
#include <deque>

#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator {

/// The time in which this process was awake. A process that was stopped or waited for a disk has
/// not heard its workers meanwhile, and that must not count as their silence.
class WakingTime {
 public:
  /// @param began_at  Of the steady clock, as all times here.
  explicit WakingTime(TimePoint began_at) : asked_at_(began_at) {}

  /// The time. What exceeds `gap_max` between two calls is left out.
  /// @param steady  Not before the one of any earlier call.
  [[nodiscard]] TimePoint at(TimePoint steady) {
    const Duration gap = steady - asked_at_;
    if (gap > gap_max) slept_ += gap - gap_max;
    asked_at_ = steady;
    return steady - slept_;
  }

  /// Several times the longest time between two calls of a process that is awake.
  static constexpr std::chrono::milliseconds gap_max{500};

 private:
  TimePoint asked_at_;
  Duration slept_{};
};

/// How fast runs have been stored lately: over the last two minutes, or since the meter began.
class RateMeter {
 public:
  explicit RateMeter(TimePoint began_at) : began_at_(began_at) {}

  /// More runs are stored.
  /// @param now  Not before any earlier one.
  void add(std::uint64_t num_runs, TimePoint now);

  /// Runs per second; 0 if none was stored lately.
  [[nodiscard]] double rate_hz(TimePoint now) const;

 private:
  static constexpr std::chrono::seconds window_{120};

  /// What was stored in a second from `began_at` on.
  struct Count {
    TimePoint began_at;
    std::uint64_t num_runs = 0;
  };

  TimePoint began_at_;
  std::deque<Count> counts_;
};

}  // namespace proofmass::coordinator
