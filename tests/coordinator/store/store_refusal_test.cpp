// Files and places that a store refuses, each with what the user reads.

#include <gmock/gmock.h>

#include "coordinator/store/store.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

using test::campaign_of;
using test::deliveries_of;
using test::store_error_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

class StoreRefusal : public test::StoreTest {
 protected:
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
  void expect_refusal_of_both(const std::string& reason, const std::string& what = "") const {
    EXPECT_EQ(error_of_open(), message(reason)) << what;
    EXPECT_EQ(error_of_open_read_only(), message(reason)) << what;
  }
};

TEST_F(StoreRefusal, ToCreateAFileThatExists) {
  test::write_file(file(), "precious");
  EXPECT_EQ(store_error_of([&] { (void)create(1); }), message("exists already"));
  EXPECT_EQ(std::filesystem::file_size(file()), 8u);
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

// SQLite would apply the log of the file that is gone to the new one.
TEST_F(StoreRefusal, ToCreateAFileBesideTheLogOfOneThatIsGone) {
  const std::filesystem::path log = file().string() + "-wal";
  const std::filesystem::path kept = file().string() + ".kept";
  {
    Store store = create(4);
    store.commit(deliveries_of(0, 4));
    std::filesystem::copy_file(log, kept);
  }
  std::filesystem::remove(file());
  std::filesystem::rename(kept, log);
  EXPECT_EQ(store_error_of([&] { (void)create(1); }),
            message("is gone, but its log campaign.db-wal is there: put the file back, or move "
                    "campaign.db-wal away and begin anew"));
  EXPECT_THAT(file_names(), ElementsAre("campaign.db-wal"));
  std::filesystem::remove(log);
  (void)create(1);
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

// SQLite would roll old pages back into the new one.
TEST_F(StoreRefusal, ToCreateAFileBesideTheJournalOfOneThatIsGone) {
  const std::filesystem::path journal = file().string() + "-journal";
  const std::string expected = message(
      "is gone, but its journal campaign.db-journal is there: put the file back, or move "
      "campaign.db-journal away and begin anew");
  test::write_file(journal, "pages of the file that is gone");
  EXPECT_EQ(store_error_of([&] { (void)create(1); }), expected);
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
    Store store = create(2000);
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
      // What is stored is what was delivered: nothing in a file from elsewhere changes it.
      {"CREATE TRIGGER t AFTER INSERT ON run_result BEGIN DELETE FROM run_result; END",
       "has what is no part of a campaign: trigger t"},
      // It is not even read to its end.
      {"PRAGMA writable_schema = ON;"
       " WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 20000)"
       " INSERT INTO sqlite_schema SELECT 'view', 'v' || i, 'v' || i, 0,"
       " 'CREATE VIEW v' || i || ' AS SELECT 1' FROM n",
       "has more in its schema than a campaign has"},
      {"DELETE FROM campaign", "is damaged: campaigns = 0; restore it from a copy"},
      {"PRAGMA application_id = 77",
       "is not a Proofmass campaign: its application_id is 77, not 1349668211"},
      {"PRAGMA user_version = 99",
       "is newer than this program: its user_version is 99, the newest known one 14"},
      {"PRAGMA user_version = 0", "is damaged: user_version = 0; restore it from a copy"},
      {"PRAGMA user_version = -1", "is damaged: user_version = -1; restore it from a copy"},
      {"PRAGMA user_version = 7",
       "was made before the first release: its user_version is 7, the oldest known one 8"}};
  for (const auto& [sql, reason] : cases) {
    std::filesystem::remove(file());
    (void)create(1);
    change(sql);
    expect_refusal_of_both(reason, sql);
  }
}

// Of a file that was closed in order only pages are checked, of any other its rows as well.
TEST_F(StoreRefusal, OfAFileWithAWrongRowAfterACoordinatorWasKilled) {
  (void)create(1);
  change("PRAGMA ignore_check_constraints = ON; UPDATE campaign SET failures_max = -2");
  EXPECT_EQ(error_of_open(), "");
  change("PRAGMA journal_mode = WAL");
  EXPECT_EQ(error_of_open(),
            message("is damaged: CHECK constraint failed in campaign; restore it from a copy"));
}

// They may be read, and `proofmass verify` names the runs.
TEST_F(StoreRefusal, ToResumeWithResultsThatFitNoDeliveryOrRun) {
  create(2).commit(deliveries_of(0, 2));
  change(
      "UPDATE run_result SET run_index = 7 WHERE run_index = 1;"
      "UPDATE delivery SET run_index = 7 WHERE run_index = 1");
  EXPECT_EQ(error_of_open(),
            message("is damaged: result of run 7, of 2 there are; restore it from a copy"));
  change(
      "UPDATE run_result SET run_index = 1 WHERE run_index = 7;"
      "DELETE FROM delivery WHERE run_index = 7");
  EXPECT_EQ(error_of_open(),
            message("is damaged: results = 2, deliveries = 1; restore it from a copy"));
  EXPECT_EQ(error_of_open_read_only(), "");
}

// Pages are sound, but no program that holds to the schema wrote these: the file is opened, and
// refused by whoever reads the value.
TEST_F(StoreRefusal, OfValuesThatTheSchemaForbids) {
  using Read = std::function<void(const Store&)>;
  const Read read_results = [](const Store& store) { (void)test::results_in(store); };
  const Read read_blamed = [](const Store& store) { (void)store.blamed_runs(); };
  const std::string insert_attempt =
      "INSERT INTO attempt (first_run, num_runs, attempt, worker_key, reason, is_blamed,"
      " lost_unix_s) VALUES ";
  struct Case {
    std::string sql;
    Read read;
    std::string damage;
  };
  const std::vector<Case> cases{
      {"UPDATE campaign SET seed = '12x'", [](const Store& store) { (void)store.seed(); },
       "seed = 12x"},
      {"UPDATE campaign SET num_runs = -1", [](const Store& store) { (void)store.num_runs(); },
       "num_runs = -1"},
      {"UPDATE campaign SET phase = 'begun'", [](const Store& store) { (void)store.control(); },
       "phase = begun"},
      {"UPDATE campaign SET failures_max = -2", [](const Store& store) { (void)store.stop_plan(); },
       "failures_max = -2"},
      // A count of 10^18 would keep a coordinator busy for years.
      {insert_attempt + "(1, 1000000000000000000, 0, 1, 'crashed', 1, 0)", read_blamed,
       "attempt at runs 1 to 1000000000000000000, of 1 there are"},
      {insert_attempt + "(0, -1, 0, 1, 'crashed', 1, 0)", read_blamed, "num_runs = -1"},
      {"UPDATE run_result SET status = 6", read_results, "status = 6 of run 0"},
      {"UPDATE run_result SET num_draws = num_draws + (1 << 32)", read_results,
       "num_draws = 4294967298 of run 0"},
      {"UPDATE run_result SET health_attitude_rad = -1", read_results,
       "health_attitude_rad of run 0 (must be in [0, 1e+90])"},
      {"UPDATE run_result SET health_square_noise = NULL", read_results,
       "health_square_noise of run 0 (must be in [0, 1e+90])"},
      {"UPDATE run_result SET loss_session = 3", read_results,
       "loss_session of run 0, which is not lost"}};
  std::vector<Delivery> deliveries = deliveries_of(0, 1);
  deliveries[0].result.health = test::values_of({1e-7, 2e-5, 1e-12, 0.25, 3e-4});
  for (const auto& [sql, read, damage] : cases) {
    std::filesystem::remove(file());
    create(1).commit(deliveries);
    change("PRAGMA ignore_check_constraints = ON; PRAGMA foreign_keys = OFF; " + sql);
    const Store store = Store::open_read_only(file());
    EXPECT_EQ(store_error_of([&] { read(store); }),
              message("is damaged: " + damage + "; restore it from a copy"))
        << sql;
  }
}

TEST_F(StoreRefusal, ToMakeAFileWithoutAName) {
  const std::string folder = (directory() / "").string();
  const std::string expected = "campaign database = " + folder + " (names no file)";
  EXPECT_EQ(store_error_of([&] { Store::create(folder, campaign_of(1), ""); }), expected);
  (void)create(1);
  EXPECT_EQ(store_error_of([&] { Store::open_read_only(file()).back_up(folder); }), expected);
  EXPECT_EQ(store_error_of([&] { Store::open_read_only(file()).back_up(""); }),
            "campaign database =  (names no file)");
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

TEST_F(StoreRefusal, OfADirectoryThatIsNotWritable) {
  (void)create(1);
  EXPECT_EQ(error_with(std::filesystem::perms(0555), [&] { Store::open(file()); }),
            "lock = " + file().string() + ".lock (Permission denied)");
}

TEST_F(StoreRefusal, OfAFileWithALogInADirectoryThatIsNotWritable) {
  (void)create(1);
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
  (void)create(1);
  std::filesystem::permissions(file(), std::filesystem::perms(0666));
  change("PRAGMA journal_mode = WAL");
  EXPECT_EQ(error_with(std::filesystem::perms(0555), [&] { Store::open_read_only(file()); }),
            expected);
}

TEST_F(StoreRefusal, OfAFileInADirectoryThatMayNotBeEntered) {
  (void)create(1);
  EXPECT_EQ(error_with(std::filesystem::perms(0000), [&] { Store::open_read_only(file()); }),
            message("cannot be reached: Permission denied"));
}

TEST_F(StoreRefusal, OfAFileThatIsNotWritable) {
  (void)create(1);
  std::filesystem::permissions(file(), std::filesystem::perms(0444));
  std::filesystem::permissions(directory(), std::filesystem::perms(0777));
  const test::OrdinaryUser user;
  EXPECT_EQ(error_of_open(), message("is not writable"));
}

}  // namespace
}  // namespace proofmass::coordinator
