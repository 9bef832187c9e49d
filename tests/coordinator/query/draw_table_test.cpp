#include "coordinator/query/draw_table.hpp"

#include <gmock/gmock.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/coordinator/query/query_fixture.hpp"

namespace proofmass::test {
namespace {

using testing::ElementsAre;

std::uint64_t bits(double value) { return std::bit_cast<std::uint64_t>(value); }

/// Laws of every kind; with wide misalignments many a draw is rejected.
MicroscopeCampaign varied_campaign(std::uint64_t num_runs) {
  MicroscopeCampaign campaign = campaign_of(num_runs);
  campaign.name = "varied";
  campaign.seed = 20260314;
  auto& laws = campaign.dispersions;
  laws[0].law = Law::normal;
  laws[0].mean = 1e-3;
  laws[0].standard_deviation = 2e-3;
  laws[1].law = Law::truncated_normal;
  laws[1].maximum = 5e-3;
  laws[1].standard_deviation = 4e-3;
  laws[24].law = Law::fixed;
  laws[24].value = 1.25e-5;
  laws[25].law = Law::table;
  laws[25].file = "offcentring.csv";
  laws[25].column = "y";
  for (std::size_t i = 6; i < 12; ++i) {
    laws[i].minimum *= 1.5;
    laws[i].maximum *= 1.5;
  }
  auto& column = campaign.table_columns.emplace_back();
  for (std::uint64_t run = 0; run < num_runs; ++run) {
    column.push_back(1e-5 / (3.0 + static_cast<double>(run)));
  }
  return campaign;
}

using DrawTable = QueryTest;

// The instrument that a simulation begins with is made of the values, each of which is part of it;
// so equal bits of all that the instrument was made of are those of the simulation.
TEST_F(DrawTable, HasTheBitsOfTheSimulationsDraws) {
  const MicroscopeCampaign campaign = varied_campaign(40);
  make_file(campaign);
  const auto rows = rows_of("SELECT run_index, quantity, value FROM draw");
  ASSERT_EQ(rows.size(), 40 * num_drawn);
  std::uint32_t num_rejected = 0;
  auto row = rows.begin();
  for (std::uint64_t run = 0; run < 40; ++run) {
    const auto table_values = campaign.table_values({run});
    const std::uint32_t num_draws = draw_instrument(campaign, {run}, table_values).num_draws;
    num_rejected += num_draws - 1;
    const DrawnValues values =
        draw_values(campaign.dispersions, campaign.seed, {run}, num_draws - 1, table_values);
    ASSERT_TRUE(is_accepted(make_instrument(values), campaign.scenario.acceptance));
    for (std::size_t i = 0; i < num_drawn; ++i, ++row) {
      EXPECT_EQ(std::get<std::int64_t>((*row)[0]), static_cast<std::int64_t>(run));
      EXPECT_EQ(std::get<std::string>((*row)[1]), drawn_names()[i]);
      EXPECT_EQ(bits(std::get<double>((*row)[2])), bits(values[i])) << run << drawn_names()[i];
    }
  }
  EXPECT_GT(num_rejected, 10u);
}

}  // namespace
}  // namespace proofmass::test

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

}  // namespace
}  // namespace proofmass::coordinator
