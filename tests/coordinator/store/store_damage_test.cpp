#include <signal.h>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/store.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

// What survives a killed process and a full disk.

using test::FileSizeLimit;
using test::run_and_kill;

using StoreCrash = test::StoreTest;

TEST_F(StoreCrash, InTheMiddleOfReadingHoldsNobodyBack) {
  run_and_kill([&] {
    Store store = create(100);
    store.commit(deliveries_of(0, 10));
    store.for_each_result([](const RunResult&) { ::raise(SIGKILL); });
  });
  EXPECT_EQ(results_in(Store::open(file())).size(), 10u);
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

// A process killed in create() leaves such files; what they hold is of no interest.
TEST_F(StoreCrash, WhileCreatingIsRepairedByCreatingAgain) {
  test::write_file(file().concat(".unfinished"), "half a database");
  test::write_file(file().concat(".unfinished-journal"), "half a journal");
  test::write_file(file().concat(".lock"), "process 1 on nowhere\n");
  create(3);
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
  EXPECT_EQ(Store::open(file()).num_runs(), 3u);
}

// Files whose content no program of ours wrote: each is refused with a StoreError, or carried on
// with, and none ends the process.

using test::write;

using StoreDamage = test::StoreTest;

TEST_F(StoreDamage, TimesThatAddUpToInfinityAreRefusedOneByOne) {
  Store store = create();
  Delivery delivery = delivery_of(0);
  for (const double compute_s : {1.7e308, -1.0, 1.1e9}) {
    delivery.compute_s = compute_s;
    EXPECT_THAT(store_error_of([&] { write(store, {delivery}); }),
                HasSubstr("(must be in [0, 1e9]; run 0)"));
  }
  delivery.compute_s = 1e9;
  EXPECT_TRUE(write(store, {delivery}).empty());
}

// A file from before times were bounded.
TEST_F(StoreDamage, AnInfiniteTimeOfAWorkerEndsNothing) {
  { create().commit(deliveries_of(0, 2)); }
  change("UPDATE worker SET compute_s = 9e999");
  Store store = Store::open(file());
  EXPECT_TRUE(store.commit(deliveries_of(2, 4)).empty());
  // No number in the file stays infinite.
  EXPECT_EQ(text("SELECT max(compute_s) FROM worker"), "1.0e+15");
  EXPECT_THAT(store_error_of([&] { store.check_integrity(); }),
              HasSubstr("is damaged: worker.compute_s"));
}

// Somebody deletes rows while a coordinator has the file.
TEST_F(StoreDamage, ARowThatIsDeletedMeanwhileIsMissedWhenItIsNeeded) {
  Store store = create();
  store.commit(deliveries_of(0, 4));
  change("DELETE FROM run_result WHERE run_index = 3");
  EXPECT_THAT(store_error_of([&] { write(store, {SecondDelivery{delivery_of(3)}}); }),
              HasSubstr("is damaged: run_result lacks run 3"));
  EXPECT_THAT(store_error_of([&] { store.check_integrity(); }), HasSubstr("is damaged: "));
  change("DELETE FROM delivery WHERE run_index = 2");
  EXPECT_THAT(store_error_of([&] { store.commit(deliveries_of(2, 3)); }),
              HasSubstr("is damaged: delivery lacks run 2, which has a result"));
  store.commit(deliveries_of(4, 5));
  change("DELETE FROM worker");
  const std::vector<Entry> wrong{SecondDelivery{test::wrong_delivery_of(1)}};
  EXPECT_NE(store_error_of([&] { write(store, wrong); }), "");
  EXPECT_EQ(test::num_contradicting(write(store, wrong)), 1) << "of a worker that is made anew";
  EXPECT_TRUE(store.commit(deliveries_of(5, 7)).empty());
}

TEST_F(StoreDamage, AFileWithoutItsCampaignIsRefusedByEveryFunction) {
  Store store = create();
  change("DELETE FROM campaign");
  for (const std::function<void()>& action : {std::function<void()>([&] { (void)store.id(); }),
                                              {[&] { (void)store.name(); }},
                                              {[&] { (void)store.num_runs(); }},
                                              {[&] { (void)store.control(); }},
                                              {[&] { (void)store.stop_plan(); }}}) {
    EXPECT_THAT(store_error_of(action), HasSubstr("is damaged"));
  }
}

using detail::Access;
using detail::Database;

class StoreStop : public test::StoreTest {
 protected:
  void SetUp() override { create(10); }
};

// Also if the process ends in between.
TEST_F(StoreStop, PlanThatIsNewLeavesAFinishedCampaignActiveUntilItsRuleIsChecked) {
  Store store = Store::open(file());
  const Entry finished = CampaignControl{.phase = wire::CampaignPhase::finished};
  (void)store.write({&finished, 1});
  store.set_stop_plan({.stop_rule = "", .num_runs_max = {}, .failures_max = 3});
  EXPECT_EQ(store.control().phase, wire::CampaignPhase::finished) << "no rule";
  const StopPlan plan{.stop_rule = "std(a_c13) within 5%", .num_runs_max = 50, .failures_max = {}};
  store.set_stop_plan(plan);
  EXPECT_EQ(store.control().phase, wire::CampaignPhase::active);
  (void)store.write({&finished, 1});
  store.set_stop_plan(plan);
  EXPECT_EQ(store.control().phase, wire::CampaignPhase::finished) << "the same plan";
}

TEST_F(StoreStop, ChecksAreKeptOnceForEachCount) {
  Store store = Store::open(file());
  store.record_stop_check(128, "std(a_c13)", {});
  store.record_stop_check(192, "std(a_c13)",
                          {.is_reached = true,
                           .estimate = 0.5,
                           .interval = Interval{.lower = 0.25, .upper = 0.75, .confidence = 0.95},
                           .relative_half_width = 0.125});
  StopCheck again;
  again.estimate = 2.0;
  store.record_stop_check(128, "std(a_c13)", again);
  const Database database(file(), Access::read_only);
  EXPECT_EQ(
      database.text("SELECT group_concat(num_runs || ' ' || statistic || ' ' || estimate || ' ' || "
                    "coalesce(lower, '-') || ' ' || coalesce(upper, '-') || ' ' || "
                    "coalesce(relative_half_width, '-') || ' ' || is_reached, ';') "
                    "FROM stop_check"),
      "128 std(a_c13) 2.0 - - - 0;192 std(a_c13) 0.5 0.25 0.75 0.125 1");
}

// The full check of a campaign database, and copies of one.

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

// SQLite forgets the constraints of a file that it opens for reading alone.
TEST_F(StoreIntegrity, IsMissedByARowThatBreaksAConstraint) {
  change("UPDATE campaign SET failures_max = -2");
  EXPECT_EQ(finding(), "is damaged: CHECK constraint failed in campaign; restore it from a copy");
  change("UPDATE campaign SET failures_max = 2");
  EXPECT_EQ(finding(), "");
  change("UPDATE run_result SET num_rounds = -1 WHERE run_index = 999");
  EXPECT_EQ(finding(), "is damaged: CHECK constraint failed in run_result; restore it from a copy");
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
