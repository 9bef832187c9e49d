// The full check of a campaign file, and copies of one.

#include <gmock/gmock.h>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/store.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

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
    Database(file(), Access::read_write)
        .execute(
            "PRAGMA foreign_keys = OFF; PRAGMA ignore_check_constraints = ON;"
            "PRAGMA writable_schema = ON; " +
            sql);
  }
  /// What the check says between the parentheses; empty if nothing.
  [[nodiscard]] std::string finding() const {
    const std::string error =
        store_error_of([&] { Store::open_read_only(file()).check_integrity(); });
    const std::string before = "campaign file = " + file().string() + " (";
    if (error.rfind(before, 0) != 0) return error;
    return error.substr(before.size(), error.size() - before.size() - 1);
  }
};

TEST_F(StoreIntegrity, IsThatOfAFileJustMade) {
  EXPECT_EQ(finding(), "");
  const Store served = Store::open(file());
  EXPECT_EQ(finding(), "");
}

TEST_F(StoreIntegrity, IsMissedByARowWithoutTheOneItRefersTo) {
  change("UPDATE delivery SET worker = 99 WHERE run_index = 17");
  EXPECT_EQ(finding(),
            "is damaged: row 17 of delivery refers to no row of worker; restore it "
            "from a copy");
}

TEST_F(StoreIntegrity, IsMissedByAnIndexThatLacksARow) {
  change(
      "UPDATE sqlite_schema SET sql = replace(sql, 'status <> 1', 'status <> 2')"
      " WHERE name = 'run_result_not_completed'");
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

TEST_F(StoreIntegrity, IsMissedByAResultThatWasChanged) {
  change("UPDATE run_result SET estimate_k2c_s2_m = 1e9 WHERE run_index = 5");
  EXPECT_EQ(finding(), "is damaged: overrun does not follow from the result of run 5");
}

TEST_F(StoreIntegrity, IsMissedByAnOverrunThatIsNone) {
  std::string all_exact = "run_index = run_index";
  for (const ParameterInfo& info : parameter_infos()) {
    const std::string name = std::string(info.name) + std::string(info.unit_suffix);
    all_exact += ", estimate_" + name + " = truth_" + name;
  }
  change("UPDATE run_result SET " + all_exact + " WHERE run_index = 999");
  EXPECT_EQ(finding(), "is damaged: overrun has a run too many");
}

TEST_F(StoreIntegrity, IsMissedByOtherWorstRuns) {
  change("UPDATE worst_run SET magnitude = 1e9 WHERE parameter = 'a_d12' AND run_index = 999");
  EXPECT_EQ(finding(), "is damaged: worst_run does not follow from the results of a_d12");
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

TEST_F(StoreBackup, TakesWhatIsStoredSoFar) {
  Store store = Store::create(directory() / "live.db", campaign_of(100), "");
  store.commit(deliveries_of(0, 50));
  Store::open_read_only(directory() / "live.db").back_up(copy());
  store.commit(deliveries_of(50, 100));
  EXPECT_EQ(results_in(Store::open_read_only(copy())).size(), 50u);
  EXPECT_EQ(results_in(store).size(), 100u);
}

TEST_F(StoreBackup, RefusesAFileThatIsThere) {
  test::write_file(copy(), "precious");
  EXPECT_EQ(store_error_of([&] { Store::open_read_only(file()).back_up(copy()); }),
            "campaign file = " + copy().string() + " (exists already)");
  EXPECT_EQ(std::filesystem::file_size(copy()), 8u);
  EXPECT_THAT(store_error_of([&] { Store::open(file()).back_up(file()); }), HasSubstr("(held by "));
  EXPECT_EQ(store_error_of([&] { Store::open_read_only(file()).back_up(file()); }),
            "campaign file = " + file().string() + " (exists already)");
}

TEST_F(StoreBackup, LeavesNothingIfTheDiskIsFull) {
  const Store store = Store::open_read_only(file());
  {
    const test::FileSizeLimit limit(100'000);
    EXPECT_EQ(store_error_of([&] { store.back_up(copy()); }),
              "campaign file = " + copy().string() +
                  ".unfinished (disk I/O error; what was committed before is safe)");
  }
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
  store.back_up(copy());
  EXPECT_THAT(file_names(), ElementsAre("campaign.db", "copy.db"));
}

TEST_F(StoreBackup, NeedsADirectory) {
  const std::filesystem::path missing = directory() / "missing" / "copy.db";
  EXPECT_EQ(store_error_of([&] { Store::open_read_only(file()).back_up(missing); }),
            "lock = " + missing.string() +
                ".lock (cannot be created: No such file or directory; the directory of a campaign "
                "file must be writable)");
}

}  // namespace
}  // namespace proofmass::coordinator
