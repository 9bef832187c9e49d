#include "worker/net/held_runs.hpp"

#include <algorithm>

namespace proofmass::worker {

std::vector<wire::HeldRuns> grouped(std::vector<HeldRun> runs, std::size_t num_ranges_max) {
  std::sort(runs.begin(), runs.end());
  std::vector<wire::HeldRuns> groups;
  std::size_t num_ranges = 0;
  for (const HeldRun& held : runs) {
    const bool is_of_last = !groups.empty() && groups.back().campaign == held.campaign &&
                            groups.back().attempt == held.attempt;
    const bool is_in_last = is_of_last && groups.back().ranges.back().end() == held.run.value;
    if (!is_in_last && num_ranges++ == num_ranges_max) break;
    if (!is_of_last) groups.push_back({held.campaign, held.attempt, {}});
    append(groups.back().ranges, held.run);
  }
  return groups;
}

std::size_t num_ranges(const std::vector<wire::HeldRuns>& held) {
  std::size_t count = 0;
  for (const wire::HeldRuns& runs : held) count += runs.ranges.size();
  return count;
}

}  // namespace proofmass::worker
