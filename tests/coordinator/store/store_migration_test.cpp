// Files that older programs made: here those of the first version of the schema, while the newest
// has the steps of the program and one more (schema/0015_later.sql).

#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdlib>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/query/query.hpp"
#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/campaign/budget.hpp"
#include "core/microscope/results/results.hpp"
#include "core/model.hpp"
#include "tests/coordinator/query/query_fixture.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

/// A file of the older version with runs 0 and 1 by `näh`, run 4 by `worker-2`, and a note.
void make_older(const std::filesystem::path& path) {
  Database old(path, Access::create);
  old.execute(detail::migrations(model(), test::schema())[0]);
  old.execute(
      "INSERT INTO campaign (campaign_uid, name, seed, num_runs, definition, model_version, build)"
      " VALUES (7, 'old', '42', 5, 'text', '" +
      std::string(model().version()) + "', 'b')");
  for (const test::ParameterInfo& info : test::parameter_infos()) {
    old.execute("INSERT INTO parameter VALUES (" + std::to_string(index(info.parameter) + 1) +
                ", '" + std::string(info.name) + "', '', '', 1, 0, 0, 0)");
  }
  for (const int run : {0, 1, 4}) {
    old.execute("INSERT INTO run_result (run_index, status, num_draws, num_rounds) VALUES (" +
                std::to_string(run) + ", 4, 1000, 0)");
  }
  old.execute(
      "INSERT INTO worker (worker_key, worker, host, num_results, compute_s, last_result_unix_s)"
      " VALUES (1, 'näh', 'h', 2, 3.0, 20), (2, 'worker-2', 'h', 1, 1.0, 30)");
  old.execute(
      "INSERT INTO delivery VALUES (0, 1, 0, 2.5, 10), (1, 1, 3, 0.5, 20), (4, 2, 0, 1, 30)");
  old.execute("INSERT INTO note (text) VALUES ('kept')");
}

class StoreMigration : public test::StoreTest {
 protected:
  void make_older_file() const { make_older(file()); }
};

// If the linker took the library's own files, there would be one version less.
TEST_F(StoreMigration, HasOneVersionMoreHere) { EXPECT_EQ(detail::schema_version(), 15); }

TEST_F(StoreMigration, KeepsResultsAndWhoDeliveredThem) {
  make_older_file();
  Store store = Store::open(file());
  EXPECT_EQ(store.name(), "old");
  EXPECT_EQ(store.id(), wire::CampaignId{7});
  EXPECT_THAT(store.finished_runs(),
              ElementsAre(RunRange{RunIndex{0}, 2}, RunRange{RunIndex{4}, 1}));
  const Database database(file(), Access::read_only);
  EXPECT_EQ(database.integer("PRAGMA user_version"), 15);
  EXPECT_EQ(
      database.text("SELECT group_concat(run_index || ' ' || worker || ' ' || attempt || ' ' || "
                    "d.compute_s || ' ' || received_unix_s, ';') "
                    "FROM delivery AS d JOIN worker USING (worker_key)"),
      "0 näh 0 2.5 10;1 näh 3 0.5 20;4 worker-2 0 1.0 30");
  EXPECT_EQ(database.text("SELECT colour || text FROM notes"), "greykept");
  EXPECT_EQ(database.integer("SELECT count(*) FROM pragma_foreign_key_check"), 0);
  EXPECT_EQ(database.text("PRAGMA integrity_check"), "ok");
  EXPECT_EQ(store.commit(test::deliveries_of(0, 5)).size(), 3u) << "were there";
}

// Its runs have none, as those of today that a method without them estimates.
TEST_F(StoreMigration, AddsStandardErrorsThatOldRunsDoNotHave) {
  make_older_file();
  Store store = Store::open(file());
  for (const RunResult& result : test::results_in(store)) {
    EXPECT_TRUE(result.standard_error.empty());
    EXPECT_TRUE(result.fit.empty());
  }
  EXPECT_EQ(integer("SELECT count(*) FROM standard_errors"), 0);
  EXPECT_EQ(integer("SELECT count(*) FROM pragma_table_info('run_result') WHERE name LIKE "
                    "'standard_error_%' OR name LIKE 'fit_%' OR name = 'correlations'"),
            13);
}

// A file keeps the budget of the program that made it, which took one level for all runs. Run 2 has
// an error of a_d11' of 1, and no other.
TEST_F(StoreMigration, KeepsABudgetOfAnAssumedLevel) {
  make_older_file();
  std::string columns, values;
  for (const test::ParameterInfo& info : test::parameter_infos()) {
    columns += ", truth_" + info.column() + ", estimate_" + info.column();
    values += info.parameter == Parameter::a_d11_prime ? ", 0, 1" : ", 0, 0";
  }
  {
    Database old(file(), Access::read_write);
    old.execute("INSERT INTO budget_coefficient VALUES ('residual_x', 'a_d11_prime', 2e-12)");
    old.execute(
        "INSERT INTO run_result (run_index, status, num_draws, num_rounds,"
        " health_residual_m_s2" +
        columns + ") VALUES (2, 1, 1, 1, 3.5e-11" + values +
        "); INSERT INTO delivery VALUES (2, 1, 0, 1, 10)");
  }
  test::RecordingWriter rows;
  EXPECT_EQ(run_query(file(), "SELECT total_m_s2 FROM run_budget", {}, rows), QueryEnd::complete);
  EXPECT_EQ(rows.rows, (std::vector<std::vector<test::OwnCell>>{{2e-12}}));
  Store store = Store::open(file());
  EXPECT_EQ(text("SELECT first_version FROM campaign"), "8");
  EXPECT_THAT(store.parameter_differences(test::campaign_of(5)),
              Each(Not(HasSubstr("budget_coefficient"))));
}

TEST_F(StoreMigration, LeadsToTheTablesOfANewFile) {
  const auto schema_text = [](const std::filesystem::path& path) {
    return Database(path, Access::read_only)
        .text("SELECT group_concat(sql, ';') FROM (SELECT sql FROM sqlite_schema ORDER BY name)");
  };
  make_older_file();
  { const Store store = Store::open(file()); }
  const std::filesystem::path fresh = directory() / "fresh.db";
  { const Store store = Store::create(fresh, test::campaign_of(5), ""); }
  EXPECT_EQ(schema_text(file()), schema_text(fresh));
}

// It is a copy that is brought up to date.
TEST_F(StoreMigration, OfAFileThatIsReadLeavesItAsItIs) {
  make_older_file();
  const std::string before = test::content_of(file());
  {
    Store store = Store::open_read_only(file());
    EXPECT_EQ(store.name(), "old");
    EXPECT_EQ(store.num_runs(), 5u);
    EXPECT_EQ(test::results_in(store).size(), 3u);
    EXPECT_THAT(store.finished_runs(),
                ElementsAre(RunRange{RunIndex{0}, 2}, RunRange{RunIndex{4}, 1}));
    EXPECT_EQ(store.control(), CampaignControl{});
    store.check_integrity();
    EXPECT_EQ(test::store_error_of([&] { store.record_event("note", ""); }),
              message("attempt to write a readonly database"));
    EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
  }
  EXPECT_TRUE(test::content_of(file()) == before);
}

TEST_F(StoreMigration, OfAFileThatIsListedReadsACopy) {
  make_older_file();
  const std::vector<std::filesystem::path> places{directory()};
  const std::vector<CampaignRecord> campaigns = list_campaigns(places);
  ASSERT_EQ(campaigns.size(), 1u);
  EXPECT_EQ(campaigns[0].problem, "");
  EXPECT_EQ(campaigns[0].status.name(), "old");
}

// A query sees the views of the newest version, also of files that are attached.
TEST_F(StoreMigration, OfFilesThatAreQueriedReadsCopies) {
  make_older_file();
  const std::filesystem::path other = directory() / "other.db";
  { const Store store = Store::create(other, test::campaign_of(5), ""); }
  const std::string before = test::content_of(file());
  const auto ask = [](const QueryFiles& files) {
    test::RecordingWriter writer;
    const std::string sql = "SELECT (SELECT count(*) FROM notes), (SELECT count(*) FROM b.notes)";
    EXPECT_EQ(run_query(files, sql, {}, writer), QueryEnd::complete);
    return writer.rows;
  };
  using Rows = std::vector<std::vector<test::OwnCell>>;
  EXPECT_EQ(ask(QueryFiles(other, {{"b", file()}})), (Rows{{std::int64_t{0}, std::int64_t{1}}}));
  EXPECT_EQ(ask(QueryFiles(file(), {{"b", other}})), (Rows{{std::int64_t{1}, std::int64_t{0}}}));
  EXPECT_EQ(ask(QueryFiles(file(), {{"b", file()}})), (Rows{{std::int64_t{1}, std::int64_t{1}}}));
  EXPECT_TRUE(test::content_of(file()) == before);
}

TEST_F(StoreMigration, OfOneFileThatIsQueriedReadsACopy) {
  make_older_file();
  const std::string before = test::content_of(file());
  test::RecordingWriter writer;
  EXPECT_EQ(run_query(file(), "SELECT count(*) FROM notes", {}, writer), QueryEnd::complete);
  EXPECT_TRUE(test::content_of(file()) == before);
}

// The connection to the copy of an older main file may write; the last one that may would fold the
// log of an attached file into it when it ends.
TEST_F(StoreMigration, OfAMainFileThatIsQueriedLeavesTheLogOfAnotherAlone) {
  make_older_file();
  const std::filesystem::path other = directory() / "other.db";
  { const Store store = Store::create(other, test::campaign_of(5), ""); }
  const std::filesystem::path copy = directory() / "copy.db";
  {
    Database writer(other, Access::read_write);
    writer.execute("PRAGMA journal_mode = WAL; INSERT INTO tag VALUES ('a', '')");
    std::filesystem::copy_file(other, copy);
    std::filesystem::copy_file(other.string() + "-wal", copy.string() + "-wal");
  }
  const std::string before = test::content_of(copy);
  test::RecordingWriter rows;
  EXPECT_EQ(run_query(QueryFiles(file(), {{"b", copy}}), "SELECT count(*) FROM b.tag", {}, rows),
            QueryEnd::complete);
  EXPECT_EQ(rows.rows, (std::vector<std::vector<test::OwnCell>>{{std::int64_t{1}}}));
  EXPECT_TRUE(test::content_of(copy) == before);
  EXPECT_TRUE(std::filesystem::exists(copy.string() + "-wal"));
}

TEST_F(StoreMigration, IsNotPossibleFromBeforeTheFirstVersion) {
  make_older_file();
  change("PRAGMA user_version = 7");
  EXPECT_EQ(test::store_error_of([&] { Store::open(file()); }),
            "campaign database = " + file().string() +
                " (was made before the first release: its user_version is 7, the oldest known one "
                "8)");
}

// Its own program could not read it afterwards.
TEST_F(StoreMigration, LeavesACampaignToTheProgramThatHasItsModel) {
  make_older_file();
  change("UPDATE campaign SET model_version = 'hardy2013-3'");
  const std::string before = test::content_of(file());
  EXPECT_THAT(test::store_error_of([&] { Store::open(file()); }),
              HasSubstr("(is of the model hardy2013-3, and this program has "));
  EXPECT_TRUE(test::content_of(file()) == before);
  EXPECT_EQ(Store::open_read_only(file()).model_version(), "hardy2013-3");
}

/// While it lives, temporary files are made in another directory.
class TemporaryFilesIn {
 public:
  explicit TemporaryFilesIn(const std::filesystem::path& directory) {
    std::filesystem::create_directory(directory);
    ::setenv("TMPDIR", directory.c_str(), 1);
  }
  ~TemporaryFilesIn() { ::unsetenv("TMPDIR"); }
  TemporaryFilesIn(const TemporaryFilesIn&) = delete;
  TemporaryFilesIn& operator=(const TemporaryFilesIn&) = delete;
};

// The file has no name, so that no end of the process leaves it behind.
TEST_F(StoreMigration, OfAFileThatIsReadLeavesNoTemporaryFile) {
  make_older_file();
  change("UPDATE campaign SET definition = printf('%.*c', 8000000, 'x')");
  const std::filesystem::path folder = directory() / "temporary";
  const TemporaryFilesIn temporary(folder);
  test::run_and_kill([&] {
    const Store store = Store::open_read_only(file());
    if (store.definition().size() != 8'000'000) ::_exit(1);
    if (!std::filesystem::is_empty(folder)) ::_exit(1);
  });
  EXPECT_TRUE(std::filesystem::is_empty(folder));
}

TEST_F(StoreMigration, OfAFileThatIsReadNeedsRoomForACopy) {
  make_older_file();
  change("UPDATE campaign SET definition = printf('%.*c', 8000000, 'x')");
  const test::FileSizeLimit limit(100'000);
  EXPECT_EQ(test::store_error_of([&] { Store::open_read_only(file()); }),
            "campaign database = " + file().string() +
                " (is older than this program, which reads a copy of it; the copy cannot be made "
                "in the temporary directory, which TMPDIR names: disk I/O error)");
}

// Nothing of the step may remain.
TEST_F(StoreMigration, ThatFailsLeavesTheFileAsItWas) {
  make_older_file();
  change("UPDATE note SET text = 'fails'");
  EXPECT_EQ(test::store_error_of([&] { Store::open(file()); }),
            message("CHECK constraint failed: text <> 'fails'"));
  const Database database(file(), Access::read_only);
  EXPECT_EQ(database.integer("PRAGMA user_version"), 8);
  EXPECT_EQ(database.text("SELECT text FROM note"), "fails");
  EXPECT_EQ(database.integer("SELECT count(*) FROM pragma_table_info('campaign') WHERE name = "
                             "'colour'"),
            0);
}

}  // namespace
}  // namespace proofmass::coordinator
