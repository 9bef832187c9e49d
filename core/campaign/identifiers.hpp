#pragma once

#include <compare>
#include <cstdint>

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

/// Largest seed: campaign files and SQLite hold integers of 63 bits.
inline constexpr std::uint64_t seed_max = (std::uint64_t{1} << 63) - 1;

}  // namespace proofmass
