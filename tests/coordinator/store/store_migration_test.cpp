// Files that older programs made.

#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdlib>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/result_rows.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/parameter.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::are_equal;
using detail::Database;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class StoreMigration : public test::StoreTest {
 protected:
  /// A file of version 3 with runs 0 and 1 by `näh`, and run 4 by `worker-2`.
  void make_file_of_version_3() const {
    Database old(file(), Access::create);
    for (int i = 0; i < 3; ++i) {
      old.execute(std::string(detail::migrations()[static_cast<std::size_t>(i)]));
    }
    old.execute("INSERT INTO campaign VALUES (1, 'old', '42', 5, 'text', 'hardy2013-1', '')");
    for (const ParameterInfo& info : parameter_infos()) {
      old.execute("INSERT INTO parameter VALUES (" + std::to_string(index(info.parameter) + 1) +
                  ", '" + std::string(info.name) + "', '', '', 1, 0, 0, 0)");
    }
    for (const int run : {0, 1, 4}) {
      old.execute("INSERT INTO run_result (run_index, status, num_draws, num_rounds) VALUES (" +
                  std::to_string(run) + ", 4, 1, 0)");
    }
    old.execute(
        "INSERT INTO delivery VALUES (0, 'näh', 0, 2.5, '2024-02-29T12:00:00.250Z'),"
        " (1, 'näh', 3, 0.5, '2024-02-29T12:00:10.999Z'),"
        " (4, 'worker-2', 0, 1.0, '2024-03-01T00:00:00.000Z')");
  }
};

TEST_F(StoreMigration, FromVersion3KeepsResultsAndWhoDeliveredThem) {
  make_file_of_version_3();
  Store store = Store::open(file());

  EXPECT_THAT(store.finished_runs(),
              ElementsAre(RunRange{RunIndex{0}, 2}, RunRange{RunIndex{4}, 1}));
  const Database database(file(), Access::read_only);
  EXPECT_EQ(
      database.text("SELECT group_concat(run_index || ' ' || name || ' ' || attempt || ' ' || "
                    "d.compute_s || ' ' || received_unix_s, ';') "
                    "FROM delivery AS d JOIN worker ON worker = worker_key"),
      "0 näh 0 2.5 1709208000;1 näh 3 0.5 1709208010;4 worker-2 0 1.0 1709251200");
  EXPECT_EQ(database.text("SELECT group_concat(worker || ' ' || num_results || ' ' || compute_s || "
                          "' ' || last_result_utc, ';') FROM worker_throughput"),
            "näh 2 3.0 2024-02-29T12:00:10Z;worker-2 1 1.0 2024-03-01T00:00:00Z");
  EXPECT_EQ(database.integer("SELECT count(*) FROM pragma_foreign_key_check"), 0);
  EXPECT_EQ(store.commit(test::deliveries_of(0, 5)).num_new, 2u);
}

TEST_F(StoreMigration, FromVersion3MakesACampaignToBeServed) {
  make_file_of_version_3();
  const wire::CampaignId id = Store::open(file()).id();
  const Store store = Store::open(file());
  EXPECT_EQ(store.id(), id);
  EXPECT_GT(id.value, 1u);
  EXPECT_EQ(store.build(), "");
  EXPECT_EQ(store.control(), CampaignControl{});
  EXPECT_THAT(store.attached_sessions(), IsEmpty());  // Their sessions are not known.
  EXPECT_THAT(store.blamed_runs(), IsEmpty());
  EXPECT_THAT(store.given_up_runs(), IsEmpty());
}

TEST_F(StoreMigration, FromVersion4KeepsStatisticsAndFindsTheRunsThatStandOut) {
  {
    Store::create(file(), test::campaign_of(30), "");
    Database old(directory() / "old.db", Access::create);
    for (std::size_t i = 0; i < 4; ++i) old.execute(std::string(detail::migrations()[i]));
    old.execute("ATTACH '" + file().string() + "' AS new");
    old.execute(
        "INSERT INTO campaign (campaign_id, name, seed, num_runs, definition,"
        " model_version) VALUES (1, 'old', '42', 30, 'text', 'hardy2013-1')");
    old.execute("INSERT INTO parameter SELECT * FROM new.parameter");
    old.execute("INSERT INTO statistic VALUES ('a_c13', 7, 0.5, 3, 0.25, 0.125, 2)");
    old.execute("INSERT INTO worker (session, name, host) VALUES ('0000000000000001', 'w', 'h')");
    // Half of the results by the old program: run 2 is the worst.
    Store store = Store::open(file());
    std::vector<Delivery> deliveries = test::deliveries_of(0, 15);
    deliveries[2].result.estimate[4] = 7.0;
    store.commit(deliveries);
    const std::string columns =
        old.text("SELECT group_concat(name) FROM pragma_table_info('run_result')");
    old.execute("INSERT INTO run_result (" + columns + ") SELECT " + columns +
                " FROM new.run_result");
    old.execute("INSERT INTO delivery SELECT run_index, 1, 0, 0.0, 0 FROM run_result");
  }
  const auto all = [&](const std::string& view) {
    return Database(file(), Access::read_only)
        .text("SELECT group_concat(quote(run_index) || parameter || quote(ratio), ';') FROM " +
              view);
  };
  const std::string worst = all("worst_runs");
  const std::string overruns = all("overruns");
  std::filesystem::rename(directory() / "old.db", file());
  Store store = Store::open(file());
  EXPECT_EQ(all("worst_runs"), worst);
  EXPECT_EQ(all("overruns"), overruns);
  EXPECT_EQ(store.summary(), std::nullopt);
  EXPECT_EQ(store.stop_plan(), StopPlan{});
  EXPECT_THAT(store.tags(), IsEmpty());
  EXPECT_EQ(Database(file(), Access::read_only)
                .text("SELECT worst || ' ' || worst_run_index || ' ' || mean || ' ' ||"
                      " standard_deviation || ' ' || num_beyond_objective || ' ' || num_runs ||"
                      " ' ' || quote(bias) FROM parameter_accuracy WHERE parameter = 'a_c13'"),
            "0.5 3 0.25 0.125 2 7 NULL");
}

TEST_F(StoreMigration, FromVersion5HasNoOwnerAndNoDigestOfTables) {
  {
    Database old(file(), Access::create);
    for (std::size_t i = 0; i < 5; ++i) old.execute(std::string(detail::migrations()[i]));
    old.execute(
        "INSERT INTO campaign (campaign_id, name, seed, num_runs, definition,"
        " model_version) VALUES (1, 'old', '42', 30, 'text', 'hardy2013-1')");
  }
  Store store = Store::open(file());
  EXPECT_EQ(store.name(), "old");
  EXPECT_EQ(store.owner(), "");
  EXPECT_EQ(store.table_digest(), "");
  EXPECT_EQ(Database(file(), Access::read_only).integer("SELECT is_log_needed FROM campaign"), 0);
}

/// What a file of version 6 says of its results and of who has them.
constexpr const char* rows_of_version_6 =
    "SELECT group_concat(quote(run_index) || quote(status) || quote(num_draws) || quote(num_rounds)"
    " || quote(truth_k2c_s2_m) || quote(estimate_a_c12_rad) || quote(error_a_c12_rad)"
    " || quote(attempt) || quote(compute_s), ';') FROM run_result JOIN delivery USING (run_index)";

// The table of results is made anew, and other tables refer to its rows.
TEST_F(StoreMigration, FromVersion6KeepsResultsThatHaveNoHealth) {
  std::string before;
  {
    const std::filesystem::path newer = directory() / "newer.db";
    std::vector<Delivery> deliveries;
    for (const auto status : {RunStatus::completed, RunStatus::not_converged, RunStatus::not_finite,
                              RunStatus::no_draw}) {
      const std::uint64_t run = deliveries.size();
      deliveries.push_back({test::result_of(run, status), test::session_1, {1}, 0.25});
    }
    const std::vector<Entry> entries{SecondDelivery{deliveries[1]}};
    Store store = Store::create(newer, test::campaign_of(5), "");
    store.commit(deliveries);
    store.write(entries);
    store.write_statistics({.num_runs = 4, .num_estimated = 2}, {}, {}, {},
                           {.results = std::string(64, 'a'), .health = ""});
    Database old(file(), Access::create);
    for (std::size_t i = 0; i < 6; ++i) old.execute(std::string(detail::migrations()[i]));
    old.execute("ATTACH '" + newer.string() + "' AS newer");
    for (const std::string table : {"campaign", "parameter", "run_result", "worker", "delivery",
                                    "audit", "overrun", "worst_run", "statistic", "summary"}) {
      const std::string columns =
          old.text("SELECT group_concat(name) FROM pragma_table_info('" + table + "')");
      old.execute("INSERT INTO main." + table + " (" + columns + ") SELECT " + columns +
                  " FROM newer." + table);
    }
    before = old.text(rows_of_version_6);
  }
  const Store store = Store::open(file());
  store.check_integrity();
  const Database database(file(), Access::read_only);
  EXPECT_EQ(database.text(rows_of_version_6), before);
  EXPECT_EQ(database.integer("SELECT count(*) FROM pragma_foreign_key_check"), 0);
  EXPECT_EQ(database.text("PRAGMA integrity_check"), "ok");
  for (const RunResult& result : test::results_in(store)) {
    EXPECT_EQ(result.health, std::nullopt);
    EXPECT_TRUE(are_equal(result, test::result_of(result.run.value, result.status)));
  }
  EXPECT_EQ(store.summary()->digests,
            (ResultDigests{.results = std::string(64, 'a'), .health = ""}));
  EXPECT_EQ(database.integer("SELECT count(*) FROM loop_health WHERE acceleration_m_s2 IS NULL"),
            3);
}

// It is a copy that is brought up to date.
TEST_F(StoreMigration, OfAFileThatIsReadLeavesItAsItIs) {
  make_file_of_version_3();
  const std::string before = test::content_of(file());
  {
    Store store = Store::open_read_only(file());
    EXPECT_TRUE(store.is_of_older_version());
    EXPECT_EQ(store.name(), "old");
    EXPECT_EQ(store.num_runs(), 5u);
    EXPECT_EQ(test::results_in(store).size(), 3u);
    EXPECT_THAT(store.finished_runs(),
                ElementsAre(RunRange{RunIndex{0}, 2}, RunRange{RunIndex{4}, 1}));
    EXPECT_EQ(store.control(), CampaignControl{});
    store.check_integrity();
    EXPECT_EQ(test::store_error_of([&] { store.record_event("note", ""); }),
              "campaign file = " + file().string() + " (attempt to write a readonly database)");
    EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
  }
  EXPECT_TRUE(test::content_of(file()) == before);
}

TEST_F(StoreMigration, OfAFileThatIsReadIsPossibleFromEachVersion) {
  for (std::size_t version = 1; version < detail::migrations().size(); ++version) {
    std::filesystem::remove(file());
    {
      Database old(file(), Access::create);
      for (std::size_t i = 0; i < version; ++i) old.execute(std::string(detail::migrations()[i]));
      old.execute(
          "INSERT INTO campaign (campaign_id, name, seed, num_runs, definition, model_version)"
          " VALUES (1, 'old', '42', 5, 'text', 'hardy2013-1')");
    }
    const Store store = Store::open_read_only(file());
    EXPECT_TRUE(store.is_of_older_version()) << version;
    EXPECT_EQ(store.num_runs(), 5u) << version;
  }
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
  make_file_of_version_3();
  Database(file(), Access::read_write)
      .execute("UPDATE campaign SET definition = printf('%.*c', 8000000, 'x')");
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
  make_file_of_version_3();
  Database(file(), Access::read_write)
      .execute("UPDATE campaign SET definition = printf('%.*c', 8000000, 'x')");
  const test::FileSizeLimit limit(100'000);
  EXPECT_EQ(test::store_error_of([&] { Store::open_read_only(file()); }),
            "campaign file = " + file().string() +
                " (is older than this program, which reads a copy of it; the copy cannot be made "
                "in the temporary directory, which TMPDIR names: disk I/O error)");
}

// A time that is none: nothing of the step may remain.
TEST_F(StoreMigration, ThatFailsLeavesTheFileAsItWas) {
  make_file_of_version_3();
  Database(file(), Access::read_write)
      .execute("UPDATE delivery SET received_utc = 'never' WHERE run_index = 4");
  EXPECT_EQ(test::store_error_of([&] { Store::open(file()); }),
            "campaign file = " + file().string() +
                " (NOT NULL constraint failed: delivery_by_worker.received_unix_s)");
  const Database database(file(), Access::read_only);
  EXPECT_EQ(database.integer("PRAGMA user_version"), 3);
  EXPECT_EQ(database.text("SELECT group_concat(worker) FROM delivery"), "näh,näh,worker-2");
  EXPECT_EQ(database.integer("SELECT count(*) FROM pragma_table_info('campaign') WHERE name = "
                             "'campaign_uid'"),
            0);
}

}  // namespace
}  // namespace proofmass::coordinator
