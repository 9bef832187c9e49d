// What survives a killed process and a full disk.

#include <gmock/gmock.h>
#include <signal.h>

#include "coordinator/store/store.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using test::campaign_of;
using test::deliveries_of;
using test::FileSizeLimit;
using test::results_in;
using test::run_and_kill;
using test::store_error_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using StoreCrash = test::StoreTest;

TEST_F(StoreCrash, LeavesEveryCommittedResult) {
  run_and_kill([&] {
    Store store = Store::create(file(), campaign_of(100), "definition");
    store.commit(deliveries_of(0, 10));
    store.commit(deliveries_of(50, 60));
    ::raise(SIGKILL);
  });
  EXPECT_EQ(results_in(Store::open_read_only(file())).size(), 20u);

  Store store = Store::open(file());
  EXPECT_EQ(store.definition(), "definition");
  EXPECT_THAT(store.finished_runs(),
              ElementsAre(RunRange{RunIndex{0}, 10}, RunRange{RunIndex{50}, 10}));
  EXPECT_EQ(store.commit(deliveries_of(0, 100)).num_new, 80u);
}

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

TEST_F(StoreCrash, OfTheDiskFailsTheCommitAndKeepsTheEarlierOnes) {
  Store store = create(5000);
  store.commit(deliveries_of(0, 100));
  {
    const FileSizeLimit limit(300'000);
    const std::string error = store_error_of([&] { store.commit(deliveries_of(100, 5000)); });
    EXPECT_EQ(error, message("disk I/O error; what was committed before is safe"));
    EXPECT_THAT(store.finished_runs(), ElementsAre(RunRange{RunIndex{0}, 100}));
  }
  EXPECT_EQ(store.commit(deliveries_of(100, 5000)).num_new, 4900u);
  EXPECT_THAT(store.finished_runs(), ElementsAre(RunRange{RunIndex{0}, 5000}));
}

TEST_F(StoreCrash, OfTheDiskWhileCreatingLeavesNoFile) {
  const FileSizeLimit limit(10'000);
  EXPECT_THAT(store_error_of([&] { create(1); }), HasSubstr("(disk I/O error; "));
  EXPECT_TRUE(file_names().empty());
}

}  // namespace
}  // namespace proofmass::coordinator
