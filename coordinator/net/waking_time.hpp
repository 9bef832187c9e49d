#pragma once

#include <chrono>

#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator {

/// The time in which this process was awake. One that was stopped, or waited for a disk, has not
/// heard what its workers said meanwhile: that must not count as their silence.
class WakingTime {
 public:
  /// @param began_at  Of the steady clock, as all times here.
  explicit WakingTime(TimePoint began_at) : asked_at_(began_at) {}

  /// The time, without what was longer than `gap_max` between two calls.
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

}  // namespace proofmass::coordinator
