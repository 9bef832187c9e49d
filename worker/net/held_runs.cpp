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
    if (is_of_last && groups.back().ranges.back().end() == held.run.value) {
      ++groups.back().ranges.back().count;
      continue;
    }
    if (num_ranges++ == num_ranges_max) break;
    if (!is_of_last) groups.push_back({held.campaign, held.attempt, {}});
    groups.back().ranges.push_back({held.run, 1});
  }
  return groups;
}

std::size_t num_ranges(const std::vector<wire::HeldRuns>& held) {
  std::size_t count = 0;
  for (const wire::HeldRuns& runs : held) count += runs.ranges.size();
  return count;
}

}  // namespace proofmass::worker
