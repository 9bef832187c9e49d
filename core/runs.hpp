#pragma once

#include <compare>
#include <cstdint>
#include <span>
#include <vector>

namespace proofmass {

/// Number of a run within its campaign, from 0. All of a run's randomness follows from the campaign
/// seed and this number.
struct RunIndex {
  std::uint64_t value = 0;
  auto operator<=>(const RunIndex&) const = default;
};

/// Runs [first, first + count) of a campaign.
struct RunRange {
  RunIndex first;
  std::uint64_t count = 0;
  auto operator<=>(const RunRange&) const = default;

  [[nodiscard]] std::uint64_t end() const { return first.value + count; }
};

/// Largest number of runs of one campaign; keeps run indices exact in SQLite and in counters.
inline constexpr std::uint64_t num_runs_max = 1'000'000'000;

/// All runs that a campaign may have.
inline constexpr RunRange all_runs{{0}, num_runs_max};

/// Largest seed: campaign files and SQLite hold integers of 63 bits.
inline constexpr std::uint64_t seed_max = (std::uint64_t{1} << 63) - 1;

/// The number of runs in ranges. @pre No run is in two of them.
[[nodiscard]] constexpr std::uint64_t num_runs_in(std::span<const RunRange> ranges) {
  std::uint64_t num_runs = 0;
  for (const RunRange& range : ranges) num_runs += range.count;
  return num_runs;
}

/// Adds a run to ascending ranges that all end before it.
inline void append(std::vector<RunRange>& ranges, RunIndex run) {
  if (ranges.empty() || ranges.back().end() != run.value) ranges.push_back({run, 0});
  ++ranges.back().count;
}

/// Runs in ascending order, each once, as the fewest ranges.
[[nodiscard]] inline std::vector<RunRange> ranges_of(std::span<const RunIndex> runs) {
  std::vector<RunRange> ranges;
  for (const RunIndex run : runs) append(ranges, run);
  return ranges;
}

/// The runs of the ranges, in their order.
[[nodiscard]] inline std::vector<RunIndex> indices_of(std::span<const RunRange> ranges) {
  std::vector<RunIndex> runs;
  for (const RunRange& range : ranges) {
    for (std::uint64_t run = range.first.value; run < range.end(); ++run) runs.push_back({run});
  }
  return runs;
}

}  // namespace proofmass
