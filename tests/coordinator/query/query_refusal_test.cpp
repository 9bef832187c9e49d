#include <fmt/format.h>
#include <gmock/gmock.h>

#include "coordinator/store/detail/database.hpp"
#include "tests/coordinator/query/query_fixture.hpp"

namespace proofmass::test {
namespace {

using coordinator::detail::Access;
using coordinator::detail::Database;
using testing::HasSubstr;

class QueryRefusal : public QueryTest {
 protected:
  QueryRefusal() { make_file(campaign_of(2), 1); }

  /// Does to the file what only a hostile program does.
  void tamper(const std::string& sql) { Database(file(), Access::read_write).execute(sql); }
  [[nodiscard]] std::string content() const {
    std::ifstream stream(file(), std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
};

TEST_F(QueryRefusal, AnswersEveryWayToWrite) {
  const std::string before = content();
  for (const std::string sql : {"DELETE FROM run_result",
                                "UPDATE campaign SET num_runs = 1",
                                "INSERT INTO event (kind, text) VALUES ('a', 'b')",
                                "REPLACE INTO event VALUES (1, 2, 3, 4)",

                                "CREATE TABLE a (b)",
                                "CREATE TEMP TABLE a (b)",
                                "CREATE TABLE a AS SELECT 1",
                                "CREATE VIEW a AS SELECT 1",
                                "CREATE TEMP VIEW a AS SELECT 1",
                                "CREATE INDEX a ON run_result (status)",
                                "CREATE TRIGGER a INSERT ON event BEGIN SELECT 1; END",
                                "CREATE TEMP TRIGGER a INSERT ON event BEGIN SELECT 1; END",
                                "CREATE VIRTUAL TABLE a USING fts5(b)",
                                "DROP TABLE run_result",
                                "DROP VIEW budget",
                                "ALTER TABLE event RENAME TO a",
                                "ALTER TABLE event ADD COLUMN a",
                                "REINDEX",
                                "ANALYZE",
                                "VACUUM",
                                "VACUUM INTO 'copy.db'",
                                "BEGIN",
                                "BEGIN IMMEDIATE",
                                "COMMIT",
                                "SAVEPOINT a",
                                "ATTACH 'other.db' AS other",
                                "ATTACH ':memory:' AS other",
                                "DETACH main",
                                "EXPLAIN DELETE FROM run_result",
                                "WITH a AS (SELECT 1) DELETE FROM run_result",
                                "DELETE FROM run_result RETURNING run_index"}) {
    EXPECT_EQ(error_of(sql), fmt::format("sql = {} (only reading is allowed)", sql));
  }
  EXPECT_EQ(content(), before);
  EXPECT_EQ(file_names(), std::set<std::string>{"campaign.db"});
}

TEST_F(QueryRefusal, LeavesTheSchemaAlone) {
  EXPECT_NE(error_of("DELETE FROM sqlite_schema"), "");
  EXPECT_NE(error_of("UPDATE sqlite_schema SET sql = ''"), "");
  EXPECT_NE(error_of("UPDATE sqlite_master SET rootpage = 1"), "");
}

TEST_F(QueryRefusal, AnswersPragmasThatChangeSomething) {
  for (const std::string sql :
       {"PRAGMA user_version = 9", "PRAGMA application_id = 1", "PRAGMA schema_version = 4",
        "PRAGMA encoding = 'UTF-16'", "PRAGMA page_size = 1024"}) {
    const std::string name = sql.substr(7, sql.find(' ', 7) - 7);
    EXPECT_EQ(error_of(sql), fmt::format("sql = {} (PRAGMA {} may be read, not set)", sql, name));
  }
  EXPECT_EQ(error_of("PRAGMA journal_mode = DELETE"),
            "sql = PRAGMA journal_mode = DELETE (PRAGMA journal_mode is not allowed)");
  for (const std::string name :
       {"writable_schema", "trusted_schema", "query_only", "wal_checkpoint", "optimize",
        "temp_store_directory", "hard_heap_limit", "mmap_size", "locking_mode",
        "case_sensitive_like", "incremental_vacuum", "shrink_memory", "ignore_check_constraints"}) {
    EXPECT_EQ(error_of("PRAGMA " + name),
              fmt::format("sql = PRAGMA {0} (PRAGMA {0} is not allowed)", name));
  }
}

TEST_F(QueryRefusal, SparesPragmasThatTell) {
  for (const std::string sql :
       {"PRAGMA user_version", "PRAGMA table_info(run_result)", "PRAGMA TABLE_INFO('campaign')",
        "PRAGMA integrity_check", "PRAGMA table_list", "SELECT * FROM pragma_table_info('event')",
        "SELECT * FROM pragma_user_version"}) {
    EXPECT_EQ(error_of(sql), "");
  }
  EXPECT_NE(error_of("SELECT * FROM pragma_wal_checkpoint"), "");
}

TEST_F(QueryRefusal, AnswersFunctionsThatLoadCode) {
  EXPECT_EQ(error_of("SELECT load_extension('evil')"),
            "sql = SELECT load_extension('evil') (the function load_extension is not allowed)");
  EXPECT_EQ(error_of("SELECT LOAD_EXTENSION('evil', 'init')"),
            "sql = SELECT LOAD_EXTENSION('evil', 'init') (the function load_extension is not "
            "allowed)");
  EXPECT_NE(error_of("SELECT fts3_tokenizer('simple', x'0000000000000000')"), "");
}

TEST_F(QueryRefusal, NamesWhatIsWrongAndWhere) {
  EXPECT_EQ(error_of("SELECT a FROM nowhere"),
            "sql = SELECT a FROM nowhere (no such table: nowhere)");
  EXPECT_EQ(error_of("SELECT run_index,\n  '²', trutth\nFROM run_result"),
            "sql =   '²', trutth (no such column: trutth, at line 2, character 8)");
  EXPECT_EQ(error_of("SELEC 1"),
            "sql = SELEC 1 (near \"SELEC\": syntax error, at line 1, character 1)");
  EXPECT_EQ(error_of("SELECT 1 +"), "sql = SELECT 1 + (incomplete input)");
  EXPECT_EQ(error_of("SELECT stdev(1, 2)"),
            "sql = SELECT stdev(1, 2) (wrong number of arguments to function stdev(), at line 1, "
            "character 8)");
}

TEST_F(QueryRefusal, TakesNoNameForText) {
  EXPECT_EQ(
      error_of("SELECT * FROM parameter WHERE parameter = \"a_c12\""),
      "sql = SELECT * FROM parameter WHERE parameter = \"a_c12\" (no such column: a_c12, at line "
      "1, character 43)");
}

TEST_F(QueryRefusal, ShortensALongQuery) {
  const std::string sql = "SELECT " + std::string(100, '1') + ", trutth";
  EXPECT_EQ(error_of(sql), "sql = SELECT " + std::string(52, '1') +
                               "… (no such column: trutth, at line 1, character 110)");
}

TEST_F(QueryRefusal, PassesOnWhatAFunctionSays) {
  EXPECT_EQ(error_of("SELECT percentile(run_index, 200) FROM run_result"),
            "sql = SELECT percentile(run_index, 200) FROM run_result (percentile: p = 200 (must be "
            "in [0, 100]))");
  EXPECT_EQ(error_of("SELECT stdev('abc')"),
            "sql = SELECT stdev('abc') (stdev: x = text or blob (must be a number))");
}

TEST_F(QueryRefusal, AnswersMoreThanOneStatement) {
  EXPECT_EQ(error_of("SELECT 1; SELECT 2"),
            "sql = SELECT 1; SELECT 2 (must be one statement, another begins at line 1, character "
            "11)");
  EXPECT_EQ(error_of("SELECT 1;\n-- more\nDROP TABLE event"),
            "sql = -- more (must be one statement, another begins at line 2, character 1)");
}

TEST_F(QueryRefusal, AnswersNoStatement) {
  EXPECT_EQ(error_of(""), "sql =  (holds no statement)");
  EXPECT_EQ(error_of("-- only a comment"), "sql = -- only a comment (holds no statement)");
  EXPECT_EQ(error_of(" ; "), "sql =  ;  (holds no statement)");
}

TEST_F(QueryRefusal, AnswersParametersWithoutAValue) {
  EXPECT_EQ(error_of("SELECT $HOME"),
            "sql = SELECT $HOME (has a parameter such as ?, :name or $name, which nothing gives a "
            "value)");
}

TEST_F(QueryRefusal, AnswersWhatIsTooLarge) {
  EXPECT_THAT(error_of("SELECT '" + std::string(1'000'000, 'a') + "'"),
              HasSubstr("(must be at most 1000000 bytes)"));
  EXPECT_THAT(error_of(std::string("SELECT 1\0, 2", 12)), HasSubstr("(must not hold a zero byte)"));
  EXPECT_THAT(error_of("SELECT zeroblob(100000000)"), HasSubstr("(string or blob too big)"));
  std::string deep = "1";
  for (int i = 0; i < 600; ++i) deep = "(" + deep + "+1)";
  EXPECT_NE(error_of("SELECT " + deep), "");
  std::string many = "SELECT 1";
  for (int i = 0; i < 200; ++i) many += " UNION ALL SELECT 1";
  EXPECT_THAT(error_of(many), HasSubstr("too many terms in compound SELECT"));
  std::string wide = "SELECT 1";
  for (int i = 0; i < 1000; ++i) wide += ", 1";
  EXPECT_THAT(error_of(wide), HasSubstr("too many columns in result set"));
}

// A view runs whenever somebody looks at what seems a table: a file that has its own is refused
// before anything is read from it.
TEST_F(QueryRefusal, AnswersAFileThatDefinesMoreThanACampaign) {
  for (const std::string body : {"load_extension('evil')", "fts3_tokenizer('simple')", "1"}) {
    tamper("DROP VIEW IF EXISTS trap; CREATE VIEW trap AS SELECT " + body + " AS a");
    EXPECT_EQ(store_error_of([&] { (void)rows_of("SELECT 1"); }),
              "campaign database = " + file().string() +
                  " (has what is no part of a campaign: view trap)");
  }
}

}  // namespace
}  // namespace proofmass::test
