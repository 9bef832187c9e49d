#include <fmt/format.h>
#include <gmock/gmock.h>

#include "coordinator/query/aggregates.hpp"
#include "tests/coordinator/query/query_fixture.hpp"

namespace proofmass::test {
namespace {

using testing::ElementsAre;

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
