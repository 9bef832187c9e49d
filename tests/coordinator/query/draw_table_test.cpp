#include "coordinator/query/draw_table.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <string>

#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/coordinator/query/query_fixture.hpp"

namespace proofmass::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

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

class DrawTable : public QueryTest {
 protected:
  [[nodiscard]] std::vector<std::int64_t> runs_of(const std::string& condition) const {
    std::vector<std::int64_t> runs;
    for (const auto& row : rows_of("SELECT DISTINCT run_index FROM draw WHERE " + condition)) {
      runs.push_back(std::get<std::int64_t>(row[0]));
    }
    return runs;
  }
  [[nodiscard]] std::int64_t count_of(const std::string& condition) const {
    return integer_of("SELECT count(*) FROM draw WHERE " + condition);
  }
};

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

TEST_F(DrawTable, NamesUnits) {
  make_file(campaign_of(1));
  EXPECT_THAT(rows_of("SELECT unit, count(*) FROM draw GROUP BY unit ORDER BY unit"),
              ElementsAre(ElementsAre(OwnCell("1"), OwnCell(std::int64_t{9})),
                          ElementsAre(OwnCell("m"), OwnCell(std::int64_t{6})),
                          ElementsAre(OwnCell("m/s²"), OwnCell(std::int64_t{12})),
                          ElementsAre(OwnCell("rad"), OwnCell(std::int64_t{24})),
                          ElementsAre(OwnCell("rad/s²"), OwnCell(std::int64_t{3})),
                          ElementsAre(OwnCell("s²/m"), OwnCell(std::int64_t{6}))));
}

TEST_F(DrawTable, HoldsTheRunsOfAnyCondition) {
  make_file(campaign_of(6));
  EXPECT_THAT(runs_of("run_index = 3"), ElementsAre(3));
  EXPECT_THAT(runs_of("run_index > 3"), ElementsAre(4, 5));
  EXPECT_THAT(runs_of("run_index >= 3 AND run_index < 5"), ElementsAre(3, 4));
  EXPECT_THAT(runs_of("run_index <= 1.5"), ElementsAre(0, 1));
  EXPECT_THAT(runs_of("run_index < 1.5"), ElementsAre(0, 1));
  EXPECT_THAT(runs_of("run_index > 3.5"), ElementsAre(4, 5));
  EXPECT_THAT(runs_of("run_index = 3.5"), ElementsAre());
  EXPECT_THAT(runs_of("run_index = '3'"), ElementsAre(3));
  EXPECT_THAT(runs_of("run_index = NULL"), ElementsAre());
  EXPECT_THAT(runs_of("run_index IN (4, 1, 9, -2)"), ElementsAre(1, 4));
  EXPECT_THAT(runs_of("run_index = -1 OR run_index > 9223372036854775806"), ElementsAre());
  EXPECT_THAT(runs_of("run_index > 2 AND run_index > 4"), ElementsAre(5));
}

TEST_F(DrawTable, HoldsTheQuantitiesOfAnyCondition) {
  make_file(campaign_of(2));
  EXPECT_EQ(count_of("quantity = 'offcentring_m.x'"), 2);
  EXPECT_EQ(count_of("quantity = 'offcentring_m.x' AND run_index = 1"), 1);
  EXPECT_EQ(count_of("quantity IN ('offcentring_m.x', 'offcentring_m.y')"), 4);
  EXPECT_EQ(count_of("quantity LIKE 'offcentring_m.%'"), 6);
  EXPECT_EQ(count_of("quantity = 'OFFCENTRING_M.X' COLLATE NOCASE"), 2);
  EXPECT_EQ(count_of("quantity = 'OFFCENTRING_M.X'"), 0);
  EXPECT_EQ(count_of("quantity = 7"), 0);
  EXPECT_EQ(count_of("quantity = NULL"), 0);
}

// Each plan of SQLite's yields what a copy of all rows yields.
TEST_F(DrawTable, YieldsTheSameInAJoinAsFromACopy) {
  make_file(campaign_of(20), 20);
  const std::string join =
      "SELECT count(*), min(a.value * b.value) FROM run_result AS r JOIN {0} AS a USING "
      "(run_index) "
      "JOIN {0} AS b ON b.run_index = a.run_index AND b.quantity = 'offcentring_m.y' "
      "WHERE a.quantity = 'offcentring_m.x' AND r.run_index % 3 = 0";
  const auto direct = rows_of(fmt::format(fmt::runtime(join), "draw"));
  const auto copied = rows_of("WITH copy AS MATERIALIZED (SELECT *, 0 AS plain FROM draw) " +
                              fmt::format(fmt::runtime(join), "copy"));
  EXPECT_EQ(direct, copied);
  EXPECT_EQ(std::get<std::int64_t>(direct[0][0]), 7);
}

TEST_F(DrawTable, ComesInTheOrderOfRunsWhicheverIsAskedFor) {
  make_file(campaign_of(3));
  EXPECT_EQ(integer_of("SELECT run_index FROM draw ORDER BY run_index LIMIT 1"), 0);
  EXPECT_EQ(integer_of("SELECT run_index FROM draw ORDER BY run_index DESC LIMIT 1"), 2);
  EXPECT_EQ(std::get<std::string>(
                rows_of("SELECT quantity FROM draw ORDER BY quantity LIMIT 1").at(0).at(0)),
            "angular_bias_rad_s2.x");
  EXPECT_EQ(std::get<std::string>(
                rows_of("SELECT quantity FROM draw ORDER BY run_index, quantity LIMIT 1")[0][0]),
            "angular_bias_rad_s2.x");
}

TEST_F(DrawTable, TakesTheNameOfItsCampaign) {
  make_file(varied_campaign(2));
  EXPECT_EQ(integer_of("SELECT count(*) FROM draw('varied')"), 120);
  EXPECT_EQ(integer_of("SELECT count(*) FROM draw(NULL)"), 120);
  EXPECT_EQ(integer_of("SELECT count(*) FROM campaign AS c, draw(c.name)"), 120);
  EXPECT_EQ(std::get<std::string>(rows_of("SELECT campaign FROM draw LIMIT 1").at(0).at(0)),
            "varied");
  EXPECT_THAT(error_of("SELECT * FROM draw('hardy2013')"),
              HasSubstr("(draw: campaign = hardy2013 (the database holds varied))"));
}

TEST_F(DrawTable, HasNoValueForARunWhoseDrawsWereAllRejected) {
  MicroscopeCampaign campaign = campaign_of(2);
  campaign.scenario.acceptance.a_d11_max = 1e-12;
  make_file(campaign);
  EXPECT_EQ(integer_of("SELECT count(*) FROM draw"), 120);
  EXPECT_EQ(integer_of("SELECT count(value) FROM draw"), 0);
}

// A scale factor that is far off is never accepted, however the rest is drawn.
TEST_F(DrawTable, HasNoValueForTheOneRunWhoseDrawsWereAllRejected) {
  MicroscopeCampaign campaign = campaign_of(3);
  campaign.dispersions[0] = {.law = Law::table, .file = "scale.csv", .column = "x"};
  campaign.table_columns = {{0.0, 0.9, 0.0}};
  make_file(campaign);
  EXPECT_THAT(
      rows_of("SELECT run_index, count(value) FROM draw GROUP BY run_index ORDER BY run_index"),
      ElementsAre(ElementsAre(OwnCell(std::int64_t{0}), OwnCell(std::int64_t{60})),
                  ElementsAre(OwnCell(std::int64_t{1}), OwnCell(std::int64_t{0})),
                  ElementsAre(OwnCell(std::int64_t{2}), OwnCell(std::int64_t{60}))));
}

TEST_F(DrawTable, IsTheCampaignOfTheFileAndNothingIsStored) {
  make_file(varied_campaign(3));
  EXPECT_EQ(integer_of("SELECT count(*) FROM sqlite_schema WHERE name LIKE '%draw%'"), 0);
}

TEST_F(DrawTable, SaysThatTheStoredDefinitionIsNoCampaign) {
  coordinator::Store::create(file(), campaign_of(2), "name = 1");
  EXPECT_THAT(error_of("SELECT * FROM draw"), HasSubstr("(draw: "));
}

TEST_F(DrawTable, SaysThatTheStoredDefinitionIsOfAnotherCampaign) {
  for (const auto& [change, message] : std::map<std::string, std::string>{
           {"name = 'other'", "campaign.name = other (must be varied, as in the definition)"},
           {"seed = '9'", "campaign.seed = 9 (must be 20260314, as in the definition)"},
           {"num_runs = 4", "campaign.num_runs = 4 (must be 3, as in the definition)"}}) {
    std::filesystem::remove(file());
    make_file(varied_campaign(3));
    test::change(file(), "UPDATE campaign SET " + change);
    EXPECT_THAT(error_of("SELECT * FROM draw"), HasSubstr(message));
  }
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
