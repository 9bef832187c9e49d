#include "worker/execution/run_ranges.hpp"

namespace proofmass::worker {

std::vector<RunRange> ranges_of(std::span<const RunIndex> runs) {
  std::vector<RunRange> ranges;
  for (const RunIndex run : runs) {
    if (ranges.empty() || ranges.back().end() != run.value) ranges.push_back({run, 0});
    ++ranges.back().count;
  }
  return ranges;
}

std::vector<RunIndex> indices_of(std::span<const RunRange> ranges) {
  std::vector<RunIndex> runs;
  for (const RunRange& range : ranges) {
    for (std::uint64_t run = range.first.value; run < range.end(); ++run) runs.push_back({run});
  }
  return runs;
}

}  // namespace proofmass::worker
