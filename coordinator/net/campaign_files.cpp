#include "coordinator/net/campaign_files.hpp"

#include <algorithm>

#include "core/statistics/stop_rule.hpp"

namespace proofmass::coordinator {

std::uint64_t horizon_of(const StopPlan& plan, std::uint64_t num_runs_wanted,
                         std::uint64_t num_runs_now) {
  if (plan.stop_rule.empty() || num_runs_wanted < num_runs_now) return num_runs_wanted;
  const std::uint64_t num_before = num_runs_now == 0 ? 0 : num_runs_now - 1;
  return std::min(next_stop_check(num_before), num_runs_wanted);
}

}  // namespace proofmass::coordinator
