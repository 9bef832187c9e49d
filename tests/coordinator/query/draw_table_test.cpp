#include <fmt/format.h>

#include "coordinator/query/aggregates.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/coordinator/query/query_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::test {
namespace {

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

// SQLite looks at each row itself where a column stands in an expression.
TEST_F(DrawTable, OfSomeRunsHasTheRowsThatAreAskedFor) {
  make_file(campaign_of(7));
  const std::string rows = "SELECT run_index FROM draw WHERE quantity = '" + drawn_names()[3] + "'";
  for (const std::string bound :
       {"-9223372036854775808", "-1e300", "-1", "-0.5", "0", "0.5", "3", "5.999", "6", "6.5", "7",
        "8", "1e300", "9223372036854775807", "NULL"}) {
    for (const std::string comparison : {"=", ">", ">=", "<", "<="}) {
      EXPECT_EQ(rows_of(rows + " AND run_index " + comparison + bound),
                rows_of(rows + " AND +run_index " + comparison + bound))
          << comparison << bound;
    }
  }
  EXPECT_THAT(rows_of("SELECT * FROM draw WHERE quantity = 'nothing'"), IsEmpty());
}

/// The aggregates as window functions.
class Window : public QueryTest {
 protected:
  Window() { make_file(campaign_of(40), 40); }

  /// Calls of each aggregate, whose columns are of the alias.
  [[nodiscard]] static std::vector<std::string> calls_on(const std::string& alias) {
    std::vector<std::string> calls;
    const std::string x =
        fmt::format("nullif({0}.error_k2d_s2_m * ({0}.run_index % 5 - 2), 0)", alias);
    const std::string y = fmt::format("{}.truth_a_c12_rad", alias);
    for (const coordinator::Aggregate& function : coordinator::aggregates()) {
      std::string text = fmt::format("{}({}", function.name, x);
      if (function.num_columns == 2) text += ", " + y;
      for (std::size_t i = function.num_columns; i < function.arguments.size(); ++i) text += ", 60";
      calls.push_back(text + ")");
    }
    return calls;
  }
};

// A frame has the value of a group that has its rows, to the last bit.
TEST_F(Window, OfAFrameIsTheAggregateOfItsRows) {
  for (const auto& [frame, condition] : std::vector<std::pair<std::string, std::string>>{
           {"ROWS BETWEEN 9 PRECEDING AND CURRENT ROW",
            "b.run_index BETWEEN a.run_index - 9 AND a.run_index"},
           {"ROWS BETWEEN 3 PRECEDING AND 5 FOLLOWING",
            "b.run_index BETWEEN a.run_index - 3 AND a.run_index + 5"},
           {"ROWS BETWEEN 8 FOLLOWING AND 12 FOLLOWING",
            "b.run_index BETWEEN a.run_index + 8 AND a.run_index + 12"},
           {"ROWS BETWEEN 6 PRECEDING AND 6 FOLLOWING EXCLUDE CURRENT ROW",
            "b.run_index BETWEEN a.run_index - 6 AND a.run_index + 6 AND b.run_index <> "
            "a.run_index"},
           {"RANGE UNBOUNDED PRECEDING", "b.run_index <= a.run_index"}}) {
    const std::vector<std::string> windows = calls_on("run_result");
    const std::vector<std::string> groups = calls_on("b");
    for (std::size_t i = 0; i < windows.size(); ++i) {
      const auto found = rows_of(
          fmt::format("SELECT {} OVER (ORDER BY run_index {}) FROM run_result ORDER BY run_index",
                      windows[i], frame));
      const auto expected = rows_of(fmt::format(
          "SELECT (SELECT {} FROM run_result AS b WHERE {}) FROM run_result AS a ORDER BY "
          "run_index",
          groups[i], condition));
      EXPECT_EQ(found, expected) << windows[i] << frame;
      EXPECT_EQ(found.size(), 40U);
    }
  }
}

TEST_F(Window, TakesPartitionsAndFilters) {
  EXPECT_THAT(rows_of("SELECT DISTINCT run_index % 2, median(run_index) FILTER (WHERE run_index < "
                      "10) OVER (PARTITION BY run_index % 2) FROM run_result ORDER BY 1"),
              ElementsAre(ElementsAre(OwnCell(std::int64_t{0}), OwnCell(4.0)),
                          ElementsAre(OwnCell(std::int64_t{1}), OwnCell(5.0))));
}

TEST_F(Window, IsNullWhereItsFrameIsEmpty) {
  EXPECT_THAT(
      rows_of("SELECT median(run_index) OVER (ORDER BY run_index ROWS BETWEEN 2 PRECEDING "
              "AND 1 PRECEDING) FROM run_result WHERE run_index < 3"),
      ElementsAre(ElementsAre(OwnCell()), ElementsAre(OwnCell(0.0)), ElementsAre(OwnCell(0.5))));
}

TEST_F(Window, PassesOnWhatAFunctionSays) {
  EXPECT_EQ(error_of("SELECT stdev('a') OVER () FROM run_result"),
            "sql = SELECT stdev('a') OVER () FROM run_result (stdev: x = text or blob (must be a "
            "number))");
  EXPECT_EQ(error_of("SELECT percentile(1, run_index) OVER (ORDER BY run_index) FROM run_result"),
            "sql = SELECT percentile(1, run_index) OVER (ORDER BY run_index) F… (percentile: p = "
            "1 (must be the same for all rows, was 0))");
}

}  // namespace
}  // namespace proofmass::test
