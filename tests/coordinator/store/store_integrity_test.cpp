// The full check of a campaign database, and copies of one.

#include <gmock/gmock.h>

#include <algorithm>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/store.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using test::campaign_of;
using test::deliveries_of;
using test::results_in;
using test::store_error_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class StoreIntegrity : public test::StoreTest {
 protected:
  void SetUp() override {
    Store::create(file(), campaign_of(1000), "definition").commit(deliveries_of(0, 1000));
  }
  /// Changes the file behind the program's back.
  void change(const std::string& sql) const {
    test::change(file(),
                 "PRAGMA foreign_keys = OFF; PRAGMA ignore_check_constraints = ON;"
                 "PRAGMA writable_schema = ON; " +
                     sql);
  }
  /// What the check says between the parentheses; empty if nothing.
  [[nodiscard]] std::string finding() const {
    const std::string error =
        store_error_of([&] { Store::open_read_only(file()).check_integrity(); });
    const std::string before = "campaign database = " + file().string() + " (";
    if (error.rfind(before, 0) != 0) return error;
    return error.substr(before.size(), error.size() - before.size() - 1);
  }
};

TEST_F(StoreIntegrity, IsMissedByAnIndexThatLacksARow) {
  const auto redefine = [&](const std::string& old, const std::string& by) {
    change("UPDATE sqlite_schema SET sql = replace(sql, '" + old + "', '" + by +
           "') WHERE name = 'run_result_not_completed'");
  };
  redefine("<> 1", "= 7");
  change("UPDATE run_result SET status = 2 WHERE run_index = 0");
  redefine("= 7", "<> 1");
  EXPECT_THAT(finding(), HasSubstr("is damaged: row 1 missing from index"));
}

TEST_F(StoreIntegrity, IsMissedByAnotherSchema) {
  change("CREATE INDEX own ON run_result (num_rounds)");
  EXPECT_EQ(finding(), "has what is no part of a campaign: index own");
  change("DROP INDEX own; DROP VIEW budget");
  EXPECT_EQ(finding(), "lacks view budget");
  change("CREATE VIEW budget AS SELECT 1");
  EXPECT_EQ(finding(), "has another definition of view budget");
}

// What anybody can change with SQL, and what is said of it.
TEST_F(StoreIntegrity, IsMissedByWhatDoesNotFollowFromTheRowsBelow) {
  std::string all_exact = "run_index = run_index";
  for (const test::ParameterInfo& info : test::parameter_infos()) {
    const std::string name = std::string(info.name) + std::string(info.unit_suffix);
    all_exact += ", estimate_" + name + " = truth_" + name;
  }
  Store::open(file()).commit(deliveries_of(7, 8));
  EXPECT_EQ(finding(), "") << "a second result";
  const std::string whole = test::content_of(file());
  const std::string digest = text("SELECT stored_digest FROM audit");
  const std::string remedy = "; restore it from a copy";
  const std::vector<std::pair<std::string, std::string>> cases{
      {"UPDATE delivery SET worker_key = 99 WHERE run_index = 17",
       "row 17 of delivery refers to no row of worker" + remedy},
      {"UPDATE run_result SET estimate_k2c_s2_m = 1e9 WHERE run_index = 5",
       "overrun does not follow from the result of run 5"},
      {"UPDATE run_result SET " + all_exact + " WHERE run_index = 999",
       "overrun has a run too many"},
      {"UPDATE worst_run SET magnitude = 1e9 WHERE parameter = 'a_d12' AND run_index = 999",
       "worst_run does not follow from the results of a_d12"},
      {"UPDATE worker SET num_results = 999",
       "worker.num_results of worker_key 1 = 999 (must be 1000, its deliveries)" + remedy},
      {"UPDATE worker SET compute_s = 500.000001",
       "worker.compute_s of worker_key 1 = 500.000001 (must be 500, of its deliveries)" + remedy},
      {"UPDATE worker SET last_result_unix_s = NULL; UPDATE delivery SET received_unix_s = 7",
       "worker.last_result_unix_s of worker_key 1 = NULL (must be 7, of its deliveries)" + remedy},
      {"INSERT INTO worker (worker, host, num_results) VALUES ('w', 'h', 1)",
       "worker.num_results of worker_key 2 = 1 (must be 0, its deliveries)" + remedy},
      {"UPDATE delivery SET compute_s = -5 WHERE run_index = 3",
       "delivery.compute_s of run 3 = -5 (must be finite and at least 0)" + remedy},
      {"UPDATE delivery SET compute_s = 9e999 WHERE run_index = 3",
       "delivery.compute_s of run 3 = inf (must be finite and at least 0)" + remedy},
      {"UPDATE audit SET is_equal = 0",
       "audit.is_equal of run 7 by worker_key 1 = 0 (must be 1, as the digests)" + remedy},
      {"UPDATE audit SET stored_digest = '0000000000000000'",
       "audit.stored_digest of run 7 by worker_key 1 = 0000000000000000 (must be " + digest + ")" +
           remedy}};
  for (const auto& [sql, what] : cases) {
    test::write_file(file(), whole);
    change(sql);
    EXPECT_EQ(finding(), "is damaged: " + what) << sql;
  }
}

// The first delivery of each run counts for its worker; sums are of commits of any size.
TEST_F(StoreIntegrity, IsThatOfWorkersWhoseSumsWereRoundedAnotherWay) {
  const std::filesystem::path path = directory() / "rounded.db";
  {
    Store store = Store::create(path, campaign_of(300), "");
    for (std::uint64_t first = 0; first < 300; first += 7) {
      auto deliveries = deliveries_of(first, std::min<std::uint64_t>(first + 7, 300));
      for (Delivery& delivery : deliveries) {
        delivery.compute_s = 0.1 * static_cast<double>(delivery.result.run.value % 11);
      }
      store.commit(deliveries);
      store.commit(deliveries);
    }
  }
  const Database database(path, Access::read_only);
  EXPECT_EQ(database.integer("SELECT compute_s = (SELECT sum(compute_s) FROM delivery)"
                             " FROM worker"),
            0)
      << "else this tests nothing";
  Store::open_read_only(path).check_integrity();
}

class StoreBackup : public StoreIntegrity {
 protected:
  [[nodiscard]] std::filesystem::path copy() const { return directory() / "copy.db"; }
};

TEST_F(StoreBackup, IsTheSameCampaignInOneFile) {
  const Store store = Store::open(file());
  store.back_up(copy());
  EXPECT_TRUE(std::filesystem::exists(copy()));
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::path(copy()).concat("-wal")));
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::path(copy()).concat(".lock")));
  const Store copied = Store::open_read_only(copy());
  EXPECT_EQ(copied.id(), store.id());
  EXPECT_EQ(copied.definition(), "definition");
  EXPECT_EQ(results_in(copied).size(), 1000u);
  copied.check_integrity();
  EXPECT_EQ(Database(copy(), Access::read_only).text("PRAGMA journal_mode"), "delete");
}

TEST_F(StoreBackup, LeavesNothingIfTheDiskIsFull) {
  const Store store = Store::open_read_only(file());
  {
    const test::FileSizeLimit limit(100'000);
    EXPECT_EQ(store_error_of([&] { store.back_up(copy()); }),
              "campaign database = " + copy().string() +
                  ".unfinished (disk I/O error; what was committed before is safe)");
  }
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
  store.back_up(copy());
  EXPECT_THAT(file_names(), ElementsAre("campaign.db", "copy.db"));
}

}  // namespace
}  // namespace proofmass::coordinator
