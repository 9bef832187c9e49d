#include "coordinator/query/drawn_campaign.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

namespace proofmass::coordinator {
namespace {

constexpr std::uint64_t num_runs = 7;
constexpr std::array comparisons{RunComparison::equal, RunComparison::above,
                                 RunComparison::at_least, RunComparison::below,
                                 RunComparison::at_most};

template <typename Number>
bool holds(std::uint64_t run, RunComparison comparison, Number bound) {
  const auto value = static_cast<long double>(run);
  const auto limit = static_cast<long double>(bound);
  switch (comparison) {
    case RunComparison::equal:
      return value == limit;
    case RunComparison::above:
      return value > limit;
    case RunComparison::at_least:
      return value >= limit;
    case RunComparison::below:
      return value < limit;
    case RunComparison::at_most:
      return value <= limit;
  }
  return false;
}

template <typename Number>
DrawScan narrowed(RunComparison comparison, Number bound) {
  DrawScan scan{.first_run = 0, .end_run = num_runs, .quantity = {}};
  scan.narrow(comparison, bound);
  return scan;
}

bool is_in(const DrawScan& scan, std::uint64_t run) {
  return run >= scan.first_run && run < scan.end_run;
}

TEST(DrawScan, HoldsJustTheRunsThatSatisfyAnInteger) {
  constexpr auto limits = std::numeric_limits<std::int64_t>();
  for (const std::int64_t bound :
       {limits.min(), limits.min() + 1, std::int64_t{-1}, std::int64_t{0}, std::int64_t{3},
        std::int64_t{6}, std::int64_t{7}, std::int64_t{8}, limits.max() - 1, limits.max()}) {
    for (const RunComparison comparison : comparisons) {
      for (std::uint64_t run = 0; run < num_runs; ++run) {
        EXPECT_EQ(is_in(narrowed(comparison, bound), run), holds(run, comparison, bound))
            << run << " " << static_cast<int>(comparison) << " " << bound;
      }
    }
  }
}

TEST(DrawScan, HoldsAllRunsThatSatisfyADoubleAndAtMostOneMore) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const double bound :
       {-infinity, -1e300, -0.5, 0.0, 0.5, 3.0, 5.999, 6.0, 6.5, 1e300, infinity}) {
    for (const RunComparison comparison : comparisons) {
      int num_more = 0;
      for (std::uint64_t run = 0; run < num_runs; ++run) {
        const bool is_wanted = holds(run, comparison, bound);
        const bool is_scanned = is_in(narrowed(comparison, bound), run);
        EXPECT_TRUE(is_scanned || !is_wanted)
            << run << " " << static_cast<int>(comparison) << " " << bound;
        num_more += is_scanned && !is_wanted ? 1 : 0;
      }
      EXPECT_LE(num_more, 1) << static_cast<int>(comparison) << " " << bound;
    }
  }
}

TEST(DrawScan, HoldsWhatSatisfiesAllConditions) {
  DrawScan scan{.first_run = 0, .end_run = num_runs, .quantity = {}};
  scan.narrow(RunComparison::above, std::int64_t{2});
  scan.narrow(RunComparison::at_most, std::int64_t{4});
  EXPECT_EQ(scan.first_run, 3u);
  EXPECT_EQ(scan.end_run, 5u);
  scan.narrow(RunComparison::at_least, std::int64_t{1});
  scan.narrow(RunComparison::below, std::int64_t{6});
  EXPECT_EQ(scan.first_run, 3u);
  EXPECT_EQ(scan.end_run, 5u);
  scan.narrow(RunComparison::below, std::int64_t{1});
  EXPECT_EQ(scan.first_run, scan.end_run);
}

TEST(DrawScan, StaysEmpty) {
  DrawScan scan{.first_run = 0, .end_run = num_runs, .quantity = {}};
  scan.leave_none();
  scan.narrow(RunComparison::at_least, std::int64_t{3});
  EXPECT_EQ(scan.first_run, scan.end_run);
}

}  // namespace
}  // namespace proofmass::coordinator
