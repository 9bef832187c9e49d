#include "coordinator/query/query.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "core/microscope/definition/campaign_definition.hpp"
#include "core/statistics/moments.hpp"
#include "tests/coordinator/query/query_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using test::OwnCell;
using test::RecordingWriter;
using testing::ElementsAre;

class Query : public test::QueryTest {};

TEST_F(Query, YieldsNamesAndValuesOfEachType) {
  make_file(test::campaign_of(2));
  RecordingWriter writer;
  const auto end =
      run_query(file(), "SELECT 7 AS a, 0.5 AS b, 'm/s²' AS c, x'00ff' AS d, NULL AS e, 9e999 AS f",
                {}, writer);
  EXPECT_EQ(end, QueryEnd::complete);
  EXPECT_THAT(writer.columns, ElementsAre("a", "b", "c", "d", "e", "f"));
  EXPECT_THAT(writer.rows, ElementsAre(ElementsAre(
                               OwnCell(std::int64_t{7}), OwnCell(0.5), OwnCell("m/s²"),
                               OwnCell(std::string("\0\xff", 2)), OwnCell(), OwnCell(HUGE_VAL))));
  EXPECT_TRUE(writer.has_ended);
}

TEST_F(Query, NamesColumnsAlsoWithoutRows) {
  make_file(test::campaign_of(2));
  RecordingWriter writer;
  (void)run_query(file(), "SELECT run_index FROM run_result", {}, writer);
  EXPECT_THAT(writer.columns, ElementsAre("run_index"));
  EXPECT_TRUE(writer.rows.empty());
  EXPECT_TRUE(writer.has_ended);
}

TEST_F(Query, KnowsTheAggregates) {
  make_file(test::campaign_of(100), 100);
  std::vector<double> errors;
  for (const auto& row : rows_of("SELECT error_k2d_s2_m FROM run_result ORDER BY 1")) {
    errors.push_back(std::get<double>(row[0]));
  }
  const Moments expected = moments(errors);
  EXPECT_EQ(number_of("SELECT stdev(error_k2d_s2_m) FROM run_result"), expected.standard_deviation);
  EXPECT_EQ(number_of("SELECT skewness(error_k2d_s2_m) FROM run_result"), expected.skewness);
  EXPECT_EQ(number_of("SELECT percentile(run_index, 25) FROM run_result"), 24.75);
  EXPECT_NEAR(number_of("SELECT correlation(truth_k2d_s2_m, run_index) FROM run_result"), 1.0,
              1e-15);
  EXPECT_EQ(number_of("SELECT rank_correlation(-truth_k2d_s2_m, run_index) FROM run_result"), -1.0);
  EXPECT_EQ(number_of("SELECT wilks_upper(run_index, 95, 95) FROM run_result"), 98.0);
}

TEST_F(Query, GroupsAggregates) {
  make_file(test::campaign_of(6), 6);
  const auto rows =
      rows_of("SELECT run_index % 2, stdev(run_index) FROM run_result GROUP BY 1 ORDER BY 1");
  EXPECT_THAT(rows, ElementsAre(ElementsAre(OwnCell(std::int64_t{0}), OwnCell(2.0)),
                                ElementsAre(OwnCell(std::int64_t{1}), OwnCell(2.0))));
}

TEST_F(Query, GivesNullForAnAggregateOfNoRows) {
  make_file(test::campaign_of(2));
  EXPECT_EQ(rows_of("SELECT stdev(run_index), percentile(run_index, 5) FROM run_result").at(0),
            (std::vector<OwnCell>{OwnCell(), OwnCell()}));
}

TEST_F(Query, ReadsEveryViewOfTheFile) {
  make_file(test::campaign_of(3), 3);
  const auto views = rows_of("SELECT name FROM sqlite_schema WHERE type IN ('table', 'view')");
  EXPECT_GT(views.size(), 10u);
  for (const auto& view : views) {
    const std::string& name = std::get<std::string>(view[0]);
    EXPECT_EQ(error_of("SELECT * FROM \"" + name + "\""), "") << name;
  }
}

TEST_F(Query, ReadsWhileACoordinatorWrites) {
  Store store =
      Store::create(file(), test::campaign_of(10), canonical_definition(test::campaign_of(10)));
  const Entry worker = test::worker_1();
  store.write({&worker, 1});
  store.commit(test::deliveries_of(0, 4));
  EXPECT_EQ(integer_of("SELECT count(*) FROM run_result"), 4);
  store.commit(test::deliveries_of(4, 9));
  EXPECT_EQ(integer_of("SELECT count(*) FROM run_result"), 9);
}

TEST_F(Query, AllowsCommentsAndASemicolon) {
  make_file(test::campaign_of(2));
  EXPECT_EQ(integer_of("-- how many?\nSELECT num_runs /* wanted */ FROM campaign; -- all\n ;"), 2);
}

TEST_F(Query, ExplainsItsPlan) {
  make_file(test::campaign_of(2));
  EXPECT_FALSE(rows_of("EXPLAIN QUERY PLAN SELECT * FROM draw WHERE run_index = 1").empty());
}

// It cannot end by itself; the limit is what ends it.
TEST_F(Query, EndsAtItsTimeLimit) {
  make_file(test::campaign_of(2));
  RecordingWriter writer;
  try {
    (void)run_query(file(),
                    "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
                    "SELECT sum(i) FROM n",
                    {.time_limit = std::chrono::duration<double>(0.05)}, writer);
    FAIL();
  } catch (const TimeLimitError& error) {
    EXPECT_STREQ(error.what(), "timeout = 0.05 (the query did not end in so many seconds)");
  }
  EXPECT_FALSE(writer.has_ended);
}

TEST_F(Query, EndsWhenItIsInterrupted) {
  make_file(test::campaign_of(2));
  RecordingWriter writer;
  int num_questions = 0;
  const QueryLimits limits{.is_interrupted = [&] { return ++num_questions == 1000; }};
  const auto end = run_query(file(),
                             "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
                             "SELECT i FROM n",
                             limits, writer);
  EXPECT_EQ(end, QueryEnd::interrupted);
  EXPECT_FALSE(writer.rows.empty());
  EXPECT_FALSE(writer.has_ended);
}

// As a table does, which shows the first rows of millions. The query would never end by itself.
TEST_F(Query, ReadsNoFurtherThanItsWriterWants) {
  make_file(test::campaign_of(2));
  RecordingWriter writer;
  writer.num_wanted = 3;
  const auto end = run_query(file(),
                             "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
                             "SELECT i FROM n",
                             {}, writer);
  EXPECT_EQ(end, QueryEnd::complete);
  EXPECT_EQ(writer.rows, (std::vector<std::vector<OwnCell>>{
                             {std::int64_t{1}}, {std::int64_t{2}}, {std::int64_t{3}}}));
  EXPECT_TRUE(writer.has_ended);
}

TEST_F(Query, SaysWhatIsWrongWithTheFile) {
  RecordingWriter writer;
  const auto ask = [&] { (void)run_query(file(), "SELECT 1", {}, writer); };
  EXPECT_EQ(test::store_error_of(ask),
            "campaign database = " + file().string() + " (does not exist)");
  test::write_file(file(), "no database, but long enough that SQLite looks at what it says");
  EXPECT_EQ(test::store_error_of(ask),
            "campaign database = " + file().string() + " (is not an SQLite database)");
}

}  // namespace
}  // namespace proofmass::coordinator
