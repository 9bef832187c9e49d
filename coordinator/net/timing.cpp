#include "coordinator/net/timing.hpp"

#include <algorithm>

namespace proofmass::coordinator {

void RateMeter::add(std::uint64_t num_runs, TimePoint now) {
  if (counts_.empty() || now - counts_.back().began_at >= std::chrono::seconds(1)) {
    counts_.push_back({.began_at = now, .num_runs = 0});
  }
  counts_.back().num_runs += num_runs;
  while (now - counts_.front().began_at > window_) counts_.pop_front();
}

double RateMeter::rate_hz(TimePoint now) const {
  const TimePoint from = std::max(began_at_, now - window_);
  const double elapsed_s = std::chrono::duration<double>(now - from).count();
  std::uint64_t num_runs = 0;
  for (const Count& count : counts_) {
    if (count.began_at >= from) num_runs += count.num_runs;
  }
  return elapsed_s > 0.0 ? static_cast<double>(num_runs) / elapsed_s : 0.0;
}

}  // namespace proofmass::coordinator
