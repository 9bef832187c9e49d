#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/store/detail/database.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/query/query_fixture.hpp"
#include "tests/message_of.hpp"

namespace proofmass::test {
namespace {

using coordinator::AttachedFile;
using coordinator::QueryFiles;
using coordinator::Store;
using coordinator::detail::Access;
using coordinator::detail::Database;
using testing::ElementsAre;
using testing::HasSubstr;
using Rows = std::vector<std::vector<OwnCell>>;

std::string content_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Campaign databases of two seeds and numbers of runs.
class Attach : public QueryTest {
 protected:
  Attach() {
    make_file(campaign_of(3), 3);
    MicroscopeCampaign other = campaign_of(5);
    other.name = "other";
    other.seed = 77;
    make(other_file(), other, 4);
  }

  static void make(const std::filesystem::path& path, const MicroscopeCampaign& campaign,
                   std::uint64_t num_results) {
    Store store = Store::create(path, campaign, canonical_definition(campaign));
    const coordinator::Entry worker = worker_1();
    store.write({&worker, 1});
    store.commit(deliveries_of(0, num_results));
  }
  // A name that a URI would read as something else.
  [[nodiscard]] std::filesystem::path other_file() const { return directory() / "o%20?x#y.db"; }

  [[nodiscard]] Rows both(const std::string& sql) const {
    return ask(QueryFiles(file(), {{"b", other_file()}}), sql);
  }
  [[nodiscard]] static Rows ask(const QueryFiles& files, const std::string& sql) {
    RecordingWriter writer;
    EXPECT_EQ(coordinator::run_query(files, sql, {}, writer), coordinator::QueryEnd::complete);
    return writer.rows;
  }
  [[nodiscard]] std::string error_of_both(const std::string& sql) const {
    try {
      (void)both(sql);
    } catch (const Error& error) {
      return error.what();
    }
    return {};
  }
};

TEST_F(Attach, ReadsEachFileUnderItsName) {
  EXPECT_EQ(both("SELECT (SELECT count(*) FROM run_result), (SELECT count(*) FROM "
                 "main.run_result), (SELECT count(*) FROM b.run_result), (SELECT seed FROM "
                 "b.campaign), (SELECT count(*) FROM b.error_long)"),
            (Rows{{std::int64_t{3}, std::int64_t{3}, std::int64_t{4}, "77", std::int64_t{40}}}));
}

TEST_F(Attach, JoinsRunsOfBoth) {
  EXPECT_EQ(both("SELECT count(*), max(abs(x.truth_k2d_s2_m - y.truth_k2d_s2_m)) FROM "
                 "run_result AS x JOIN b.run_result AS y USING (run_index)"),
            (Rows{{std::int64_t{3}, 0.0}}));
}

TEST_F(Attach, DrawsTheRunsOfTheNamedDatabase) {
  const Rows mine = ask(other_file(), "SELECT * FROM draw");
  ASSERT_EQ(mine.size(), 300U);
  EXPECT_EQ(both("SELECT * FROM draw('b')"), mine);
  EXPECT_EQ(both("SELECT * FROM draw('B')"), mine);
  EXPECT_NE(both("SELECT * FROM draw WHERE run_index < 3"),
            both("SELECT * FROM draw('b') WHERE run_index < 3"));
  for (const std::string argument : {"", "('main')", "(NULL)", "('hardy2013')"}) {
    EXPECT_EQ(both("SELECT * FROM draw" + argument), rows_of("SELECT * FROM draw")) << argument;
  }
  EXPECT_EQ(both("SELECT count(*), sum(x.value = y.value) FROM draw AS x JOIN draw('b') AS y "
                 "USING (run_index, quantity)"),
            (Rows{{std::int64_t{180}, std::int64_t{0}}}));
}

// It would else be the table of the main database under the name of the other.
TEST_F(Attach, RefusesDrawsUnderTheNameOfADatabase) {
  EXPECT_EQ(error_of_both("SELECT * FROM b.draw"),
            "sql = SELECT * FROM b.draw (no such table: b.draw; name the database in the argument, "
            "as in draw('b'))");
  EXPECT_THAT(error_of_both("SELECT * FROM draw('c')"),
              HasSubstr("(draw: campaign = c (the database holds hardy2013; attached: b))"));
}

TEST_F(Attach, RefusesANameThatMeansTwoDatabases) {
  const QueryFiles files(file(), {{"hardy2013", other_file()}});
  const auto text = message_of<Error>([&] { (void)ask(files, "SELECT * FROM draw('hardy2013')"); });
  EXPECT_THAT(text, HasSubstr("draw: campaign = hardy2013 (is attached under the name of the "
                              "campaign in main: attach it under another name)"));
}

TEST_F(Attach, ChecksEachFileAsTheMainOne) {
  const auto broken = directory() / "broken.db";
  write_file(broken, "no database, but long enough that SQLite looks at what it says");
  const auto text_with = [&](const std::filesystem::path& path) {
    return store_error_of([&] { (void)ask(QueryFiles(file(), {{"b", path}}), "SELECT 1"); });
  };
  EXPECT_EQ(text_with(broken),
            "campaign database = " + broken.string() + " (is not an SQLite database)");
  EXPECT_EQ(text_with(directory() / "none.db"),
            "campaign database = " + (directory() / "none.db").string() + " (does not exist)");
  Database(other_file(), Access::read_write).execute("CREATE VIEW trap AS SELECT 1");
  EXPECT_EQ(text_with(other_file()), "campaign database = " + other_file().string() +
                                         " (has what is no part of a campaign: view trap)");
}

TEST_F(Attach, LetsNoStatementWriteOrAttach) {
  const std::string before = content_of(other_file());
  for (const std::string sql :
       {"DELETE FROM b.run_result", "ATTACH 'c.db' AS c", "DETACH b", "VACUUM b",
        "CREATE TABLE b.a (c)", "DROP TABLE draw", "DROP TABLE temp.draw",
        "INSERT INTO draw VALUES (1)", "CREATE VIRTUAL TABLE temp.a USING proofmass_draw"}) {
    EXPECT_EQ(error_of_both(sql).empty(), false) << sql;
  }
  EXPECT_EQ(error_of_both("PRAGMA b.user_version = 3"),
            "sql = PRAGMA b.user_version = 3 (PRAGMA user_version may be read, not set)");
  EXPECT_EQ(content_of(other_file()), before);
}

// A live file has a log beside it, which a connection that may write would fold in.
TEST_F(Attach, LeavesAFileAloneThatACoordinatorWrites) {
  Store store = Store::open(other_file());
  store.commit(deliveries_of(4, 5));
  EXPECT_EQ(both("SELECT count(*) FROM b.run_result"), (Rows{{std::int64_t{5}}}));
  store.check_place();
  EXPECT_GT(store.log_size(), 0U);
}

TEST_F(Attach, TakesAsManyFilesAsThereIsRoomFor) {
  std::vector<AttachedFile> attached;
  for (std::size_t i = 0; i < coordinator::attached_files_max; ++i) {
    attached.push_back({fmt::format("b{}", i), other_file()});
  }
  EXPECT_EQ(ask(QueryFiles(file(), attached),
                "SELECT (SELECT count(*) FROM b9.run_result), (SELECT count(*) FROM draw('b9'))"),
            (Rows{{std::int64_t{4}, std::int64_t{300}}}));
}

TEST_F(Attach, TakesNamesThatSqlReadsWithoutQuotes) {
  for (const char* name : {"b", "_1", "Seed2"})
    EXPECT_NO_THROW(coordinator::check_attached_name(name));
  for (const std::string name : {"", "main", "TEMP", "1b", "a.b", "a b", "a\"b"}) {
    EXPECT_EQ(message_of<Error>([&] { coordinator::check_attached_name(name); }),
              fmt::format("name = {} (must be 1 to 64 letters, digits and _, not begin with a "
                          "digit, and be neither main nor temp)",
                          name));
  }
}

}  // namespace
}  // namespace proofmass::test
