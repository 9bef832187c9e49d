// Files and places that a store refuses, each with what the user reads.

#include <gmock/gmock.h>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/store.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using test::campaign_of;
using test::deliveries_of;
using test::store_error_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

class StoreRefusal : public test::StoreTest {
 protected:
  /// `campaign database = <file()> (<reason>)`
  [[nodiscard]] std::string message(const std::string& reason) const {
    return "campaign database = " + file().string() + " (" + reason + ")";
  }
  [[nodiscard]] std::string error_of_open() const {
    return store_error_of([&] { Store::open(file()); });
  }
  [[nodiscard]] std::string error_of_open_read_only() const {
    return store_error_of([&] { Store::open_read_only(file()); });
  }
  /// What an action without the rights of root throws while the directory has these permissions.
  [[nodiscard]] std::string error_with(std::filesystem::perms permissions,
                                       const std::function<void()>& action) const {
    std::filesystem::permissions(directory(), permissions);
    std::string error;
    {
      const test::OrdinaryUser user;
      error = store_error_of(action);
    }
    std::filesystem::permissions(directory(), std::filesystem::perms(0755));
    return error;
  }
  void create(std::uint64_t num_runs = 1) const {
    Store::create(file(), campaign_of(num_runs), "");
  }
};

TEST_F(StoreRefusal, OfAMissingFile) {
  EXPECT_EQ(error_of_open(), message("does not exist"));
  EXPECT_EQ(error_of_open_read_only(), message("does not exist"));
  EXPECT_TRUE(file_names().empty());
}

TEST_F(StoreRefusal, ToCreateAFileThatExists) {
  test::write_file(file(), "precious");
  EXPECT_EQ(store_error_of([&] { create(); }), message("exists already"));
  EXPECT_EQ(std::filesystem::file_size(file()), 8u);
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

// SQLite would apply the log of the file that is gone to the new one.
TEST_F(StoreRefusal, ToCreateAFileBesideTheLogOfOneThatIsGone) {
  const std::filesystem::path log = file().string() + "-wal";
  const std::filesystem::path kept = file().string() + ".kept";
  {
    Store store = Store::create(file(), campaign_of(4), "");
    store.commit(deliveries_of(0, 4));
    std::filesystem::copy_file(log, kept);
  }
  std::filesystem::remove(file());
  std::filesystem::rename(kept, log);
  EXPECT_EQ(store_error_of([&] { create(); }),
            message("is gone, but its log campaign.db-wal is there: put the file back, or move "
                    "campaign.db-wal away and begin anew"));
  EXPECT_THAT(file_names(), ElementsAre("campaign.db-wal"));
  std::filesystem::remove(log);
  create();
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

// SQLite would roll old pages back into the new one.
TEST_F(StoreRefusal, ToCreateAFileBesideTheJournalOfOneThatIsGone) {
  const std::filesystem::path journal = file().string() + "-journal";
  const std::string expected = message(
      "is gone, but its journal campaign.db-journal is there: put the file back, or move "
      "campaign.db-journal away and begin anew");
  test::write_file(journal, "pages of the file that is gone");
  EXPECT_EQ(store_error_of([&] { create(); }), expected);
  EXPECT_EQ(store_error_of([&] { Store::check_absence(file()); }), expected);
  const std::filesystem::path source = directory() / "source.db";
  const Store store = Store::create(source, campaign_of(1), "");
  EXPECT_EQ(store_error_of([&] { store.back_up(file()); }), expected);
  EXPECT_FALSE(std::filesystem::exists(file()));
  test::write_file(journal, "");  // As some modes leave it behind.
  EXPECT_EQ(store_error_of([&] { store.back_up(file()); }), "");
}

// A file that was restored from a copy, beside the log of the file before it: SQLite would copy the
// log into it when the connection is closed, and nothing could mend it any more.
TEST_F(StoreRefusal, OfAFileWithTheLogOfAnotherLeavesItAsItIs) {
  const std::filesystem::path log = file().string() + "-wal";
  const std::filesystem::path copy = file().string() + ".copy";
  const std::filesystem::path kept = file().string() + ".kept";
  {
    Store store = Store::create(file(), campaign_of(2000), "");
    store.commit(deliveries_of(0, 10));
    ASSERT_EQ(store.rest(), std::nullopt);
    std::filesystem::copy_file(file(), copy);
    store.commit(deliveries_of(10, 200));
    ASSERT_EQ(store.rest(), std::nullopt);
    store.commit(deliveries_of(200, 2000));
    std::filesystem::copy_file(log, kept);
  }
  std::filesystem::rename(copy, file());
  std::filesystem::rename(kept, log);
  const std::string bytes = test::content_of(file());
  EXPECT_THAT(error_of_open(), HasSubstr("is damaged"));
  EXPECT_EQ(test::content_of(file()), bytes);
  std::filesystem::remove(log);
  EXPECT_THAT(Store::open(file()).finished_runs(), ElementsAre(RunRange{RunIndex{0}, 10}));
}

TEST_F(StoreRefusal, OfAFileThatIsNotADatabase) {
  test::write_file(file(), "name = \"hardy2013\"\n" + std::string(1000, '#'));
  EXPECT_EQ(error_of_open(), message("is not an SQLite database"));
  EXPECT_EQ(error_of_open_read_only(), message("is not an SQLite database"));
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

TEST_F(StoreRefusal, OfAnEmptyFile) {
  test::write_file(file(), "");
  EXPECT_EQ(error_of_open(),
            message("is not a Proofmass campaign: its application_id is 0, not 1349668211"));
}

TEST_F(StoreRefusal, OfADatabaseOfAnotherApplication) {
  Database(file(), Access::create).execute("CREATE TABLE t (x); PRAGMA application_id = 77");
  const std::string expected =
      message("is not a Proofmass campaign: its application_id is 77, not 1349668211");
  EXPECT_EQ(error_of_open(), expected);
  EXPECT_EQ(error_of_open_read_only(), expected);
}

TEST_F(StoreRefusal, OfANewerFile) {
  create();
  Database(file(), Access::read_write).execute("PRAGMA user_version = 99");
  const std::string expected =
      message("is newer than this program: its user_version is 99, the newest known one 9");
  EXPECT_EQ(error_of_open(), expected);
  EXPECT_EQ(error_of_open_read_only(), expected);
}

// What is stored is what was delivered: nothing in a file from elsewhere changes it.
TEST_F(StoreRefusal, OfAFileThatActsByItself) {
  create();
  Database(file(), Access::read_write)
      .execute("CREATE TRIGGER t AFTER INSERT ON run_result BEGIN DELETE FROM run_result; END");
  EXPECT_EQ(error_of_open(), message("has what is no part of a campaign: trigger t"));
  EXPECT_EQ(error_of_open_read_only(), message("has what is no part of a campaign: trigger t"));
}

// Each would take for ever, or do harm, as soon as somebody reads a row or adds one.
TEST_F(StoreRefusal, OfAFileWhoseSchemaIsNotThatOfACampaign) {
  const std::string endless =
      "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT max(i) FROM n";
  const auto replace = [](const std::string& name, const std::string& old, const std::string& by) {
    return "PRAGMA writable_schema = ON; UPDATE sqlite_schema SET sql = replace(sql, '" + old +
           "', '" + by + "') WHERE name = '" + name + "'";
  };
  const std::vector<std::pair<std::string, std::string>> cases{
      {"ALTER TABLE campaign RENAME TO c; CREATE VIEW campaign AS " + endless,
       "has what is no part of a campaign: table c"},
      {"DROP TABLE tag; CREATE VIEW tag AS " + endless,
       "has what is no part of a campaign: view tag"},
      {"DROP VIEW budget; CREATE VIEW budget AS " + endless,
       "has another definition of view budget"},
      {"CREATE INDEX own ON run_result (hex(zeroblob(status * 9999999)))",
       "has what is no part of a campaign: index own"},
      {"ALTER TABLE note ADD COLUMN g TEXT AS (hex(zeroblob(99999999)))",
       "has another definition of table note"},
      {replace("note", "note_id ", "nota_id "), "has another definition of table note"},
      {"PRAGMA writable_schema = ON; UPDATE sqlite_schema SET tbl_name = 'tag' WHERE name = "
       "'audit_contradiction'",
       "is damaged: malformed database schema (audit_contradiction); restore it from a copy"},
      {"PRAGMA writable_schema = ON; INSERT INTO sqlite_schema SELECT type, name, tbl_name, 0, "
       "'CREATE VIEW other AS SELECT 1' FROM sqlite_schema WHERE name = 'budget'",
       "is damaged: malformed database schema (budget); restore it from a copy"},
      {"PRAGMA user_version = 0", "is damaged: user_version = 0; restore it from a copy"},
      {"PRAGMA user_version = -1", "is damaged: user_version = -1; restore it from a copy"},
      {"PRAGMA user_version = 7",
       "was made before the first release: its user_version is 7, the oldest known one 8"}};
  for (const auto& [sql, reason] : cases) {
    std::filesystem::remove(file());
    create();
    Database(file(), Access::read_write).execute(sql);
    EXPECT_EQ(error_of_open(), message(reason)) << sql;
    EXPECT_EQ(error_of_open_read_only(), message(reason)) << sql;
  }
}

// What is no part of a campaign is not even read to its end.
TEST_F(StoreRefusal, OfAFileWithAnEndlessSchema) {
  create();
  Database(file(), Access::read_write)
      .execute(
          "PRAGMA writable_schema = ON;"
          " WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 20000)"
          " INSERT INTO sqlite_schema SELECT 'view', 'v' || i, 'v' || i, 0,"
          " 'CREATE VIEW v' || i || ' AS SELECT 1' FROM n");
  EXPECT_EQ(error_of_open(), message("has more in its schema than a campaign has"));
  EXPECT_EQ(error_of_open_read_only(), message("has more in its schema than a campaign has"));
}

// Of a file that was closed in order only pages are checked, of any other its rows as well.
TEST_F(StoreRefusal, OfAFileWithAWrongRowAfterACoordinatorWasKilled) {
  create();
  Database(file(), Access::read_write)
      .execute("PRAGMA ignore_check_constraints = ON; UPDATE campaign SET failures_max = -2");
  EXPECT_EQ(error_of_open(), "");
  Database(file(), Access::read_write).execute("PRAGMA journal_mode = WAL");
  EXPECT_EQ(error_of_open(),
            message("is damaged: CHECK constraint failed in campaign; restore it from a copy"));
}

TEST_F(StoreRefusal, OfAFileWithoutItsCampaign) {
  create();
  Database(file(), Access::read_write).execute("DELETE FROM campaign");
  const std::string expected = message("is damaged: campaigns = 0; restore it from a copy");
  EXPECT_EQ(error_of_open(), expected);
  EXPECT_EQ(error_of_open_read_only(), expected);
}

// Pages are sound, but no program that holds to the schema wrote these.
TEST_F(StoreRefusal, OfValuesThatTheSchemaForbids) {
  const auto error_of = [&](const std::string& assignment, const auto& read) {
    std::filesystem::remove(file());
    create();
    Database(file(), Access::read_write)
        .execute("PRAGMA ignore_check_constraints = ON; UPDATE campaign SET " + assignment);
    const Store store = Store::open_read_only(file());
    return store_error_of([&] { read(store); });
  };
  const auto damage = [&](const std::string& what) {
    return message("is damaged: " + what + "; restore it from a copy");
  };
  EXPECT_EQ(error_of("seed = '12x'", [](const Store& store) { (void)store.seed(); }),
            damage("seed = 12x"));
  EXPECT_EQ(error_of("num_runs = -1", [](const Store& store) { (void)store.num_runs(); }),
            damage("num_runs = -1"));
  EXPECT_EQ(error_of("phase = 'begun'", [](const Store& store) { (void)store.control(); }),
            damage("phase = begun"));
  EXPECT_EQ(error_of("failures_max = -2", [](const Store& store) { (void)store.stop_plan(); }),
            damage("failures_max = -2"));
}

// It may be read, and `proofmass verify` names the runs.
TEST_F(StoreRefusal, ToResumeWithAResultThatNobodyDelivered) {
  Store::create(file(), campaign_of(2), "").commit(deliveries_of(0, 2));
  Database(file(), Access::read_write).execute("DELETE FROM delivery WHERE run_index = 1");
  EXPECT_EQ(error_of_open(),
            message("is damaged: results = 2, deliveries = 1; restore it from a copy"));
  EXPECT_EQ(error_of_open_read_only(), "");
}

TEST_F(StoreRefusal, ToResumeWithAResultOfARunThatThereIsNot) {
  Store::create(file(), campaign_of(2), "").commit(deliveries_of(0, 2));
  Database(file(), Access::read_write)
      .execute(
          "UPDATE run_result SET run_index = 7 WHERE run_index = 1;"
          "UPDATE delivery SET run_index = 7 WHERE run_index = 1");
  EXPECT_EQ(error_of_open(),
            message("is damaged: result of run 7, of 2 there are; restore it from a copy"));
  EXPECT_EQ(error_of_open_read_only(), "");
}

// A count of 10^18 would keep a coordinator busy for years.
TEST_F(StoreRefusal, OfAnAttemptAtRunsThatThereAreNot) {
  create();
  Database(file(), Access::read_write)
      .execute(
          "INSERT INTO attempt (first_run, num_runs, attempt, worker_key, reason, is_blamed,"
          " lost_unix_s) VALUES (1, 1000000000000000000, 0, 1, 'crashed', 1, 0)");
  const Store store = Store::open_read_only(file());
  EXPECT_EQ(store_error_of([&] { (void)store.blamed_runs(); }),
            message("is damaged: attempt at runs 1 to 1000000000000000000, of 1 there are; "
                    "restore it from a copy"));
}

TEST_F(StoreRefusal, OfAResultWithAStatusThatThereIsNot) {
  Store::create(file(), campaign_of(1), "").commit(deliveries_of(0, 1));
  Database(file(), Access::read_write)
      .execute("PRAGMA ignore_check_constraints = ON; UPDATE run_result SET status = 6");
  const Store store = Store::open_read_only(file());
  EXPECT_EQ(store_error_of([&] { store.for_each_result([](const RunResult&) {}); }),
            message("is damaged: status = 6 of run 0; restore it from a copy"));
}

TEST_F(StoreRefusal, OfAResultWithHealthThatThereIsNot) {
  std::vector<Delivery> deliveries = deliveries_of(0, 1);
  deliveries[0].result.health = test::values_of({1e-7, 2e-5, 1e-12, 0.25, 3e-4});
  Store::create(file(), campaign_of(1), "").commit(deliveries);
  const auto refusal_after = [&](const std::string& change) {
    Database(file(), Access::read_write).execute("UPDATE run_result SET " + change);
    const Store store = Store::open_read_only(file());
    return store_error_of([&] { store.for_each_result([](const RunResult&) {}); });
  };
  EXPECT_EQ(refusal_after("health_attitude_rad = -1"),
            message("is damaged: health_attitude_rad of run 0 (must be in [0, 1e+90]); restore it "
                    "from a copy"));
  EXPECT_EQ(refusal_after("health_attitude_rad = 1, health_square_noise = NULL"),
            message("is damaged: health_square_noise of run 0 (must be in [0, 1e+90]); restore it "
                    "from a copy"));
  EXPECT_EQ(
      refusal_after("health_square_noise = 0; PRAGMA ignore_check_constraints = ON;"
                    " UPDATE run_result SET loss_session = 3"),
      message("is damaged: loss_session of run 0, which is not lost; restore it from a copy"));
}

TEST_F(StoreRefusal, ToMakeAFileWithoutAName) {
  const std::string folder = (directory() / "").string();
  const std::string expected = "campaign database = " + folder + " (names no file)";
  EXPECT_EQ(store_error_of([&] { Store::create(folder, campaign_of(1), ""); }), expected);
  create();
  EXPECT_EQ(store_error_of([&] { Store::open_read_only(file()).back_up(folder); }), expected);
  EXPECT_EQ(store_error_of([&] { Store::open_read_only(file()).back_up(""); }),
            "campaign database =  (names no file)");
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

TEST_F(StoreRefusal, OfWhatIsNoFile) {
  std::filesystem::create_directory(file());
  EXPECT_EQ(error_of_open(), message("is no file"));
  EXPECT_EQ(error_of_open_read_only(), message("is no file"));
}

TEST_F(StoreRefusal, OfATruncatedFile) {
  Store::create(file(), campaign_of(1000), "").commit(deliveries_of(0, 1000));
  std::filesystem::resize_file(file(), std::filesystem::file_size(file()) / 2);
  EXPECT_THAT(error_of_open(), HasSubstr("(is damaged: "));
  EXPECT_THAT(error_of_open_read_only(), HasSubstr("(is damaged: "));
}

TEST_F(StoreRefusal, OfASecondCoordinator) {
  const Store store = Store::create(file(), campaign_of(1), "");
  EXPECT_THAT(error_of_open(), MatchesRegex("lock = .*/campaign.db.lock \\(held by process " +
                                            std::to_string(::getpid()) +
                                            " on .+; a campaign has one coordinator at a time\\)"));
  EXPECT_THAT(store_error_of([&] { create(); }), HasSubstr("(held by process "));
}

TEST_F(StoreRefusal, OfAFileThatHasAnotherName) {
  create();
  std::filesystem::create_hard_link(file(), directory() / "other.db");
  EXPECT_EQ(error_of_open(),
            message("has 2 names (hard links), must have one; make copies instead"));
  EXPECT_EQ(store_error_of([&] { Store::open_read_only(file()); }), "");
  std::filesystem::remove(directory() / "other.db");
  EXPECT_EQ(error_of_open(), "");
}

TEST_F(StoreRefusal, OfADirectoryThatDoesNotExist) {
  const std::filesystem::path missing = directory() / "missing";
  EXPECT_EQ(store_error_of([&] { Store::create(missing / "campaign.db", campaign_of(1), ""); }),
            "directory = " + missing.string() + " (No such file or directory)");
}

TEST_F(StoreRefusal, OfADirectoryThatIsNotWritable) {
  create();
  EXPECT_EQ(error_with(std::filesystem::perms(0555), [&] { Store::open(file()); }),
            "lock = " + file().string() + ".lock (Permission denied)");
}

TEST_F(StoreRefusal, OfAFileWithALogInADirectoryThatIsNotWritable) {
  create();
  test::run_and_kill([&] {
    auto* const killed = new Store(Store::open(file()));  // Never closed.
    killed->commit(deliveries_of(0, 1));
  });
  std::filesystem::remove(file().string() + "-shm");
  EXPECT_EQ(error_with(std::filesystem::perms(0555), [&] { Store::open_read_only(file()); }),
            message("has a log that only a user who may write to its directory can read"));
}

TEST_F(StoreRefusal, ToMakeALogOrAJournalInADirectoryThatIsNotWritable) {
  const std::string expected = message(
      "needs a log or a journal beside it, and its directory is not writable; use a copy in a "
      "directory that is");
  create();
  std::filesystem::permissions(file(), std::filesystem::perms(0666));
  test::change(file(), "PRAGMA journal_mode = WAL");
  EXPECT_EQ(error_with(std::filesystem::perms(0555), [&] { Store::open_read_only(file()); }),
            expected);
}

TEST_F(StoreRefusal, OfAFileInADirectoryThatMayNotBeEntered) {
  create();
  EXPECT_EQ(error_with(std::filesystem::perms(0000), [&] { Store::open_read_only(file()); }),
            message("cannot be reached: Permission denied"));
}

TEST_F(StoreRefusal, OfAFileThatIsNotWritable) {
  create();
  std::filesystem::permissions(file(), std::filesystem::perms(0444));
  std::filesystem::permissions(directory(), std::filesystem::perms(0777));
  const test::OrdinaryUser user;
  EXPECT_EQ(error_of_open(), message("is not writable"));
}

TEST_F(StoreRefusal, ToWriteThroughAReader) {
  create();
  Store reader = Store::open_read_only(file());
  EXPECT_EQ(store_error_of([&] { reader.record_event("note", ""); }),
            message("attempt to write a readonly database"));
}

}  // namespace
}  // namespace proofmass::coordinator
