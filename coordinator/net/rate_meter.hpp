#pragma once

#include <chrono>
#include <cstdint>
#include <deque>

#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator {

/// How fast runs have been stored lately: over the last two minutes, or since the meter began.
class RateMeter {
 public:
  explicit RateMeter(TimePoint began_at) : began_at_(began_at) {}

  /// So many more runs are stored.
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
