#include "coordinator/net/waking_time.hpp"

namespace proofmass::coordinator {

TimePoint WakingTime::at(TimePoint steady) {
  const Duration gap = steady - asked_at_;
  if (gap > gap_max) slept_ += gap - gap_max;
  asked_at_ = steady;
  return steady - slept_;
}

}  // namespace proofmass::coordinator
