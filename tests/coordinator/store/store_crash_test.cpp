// What survives a killed process and a full disk.

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <array>

#include "coordinator/store/store.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using test::campaign_of;
using test::deliveries_of;
using test::results_in;
using test::store_error_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using StoreCrash = test::StoreTest;

/// Runs `action` in a child process that is killed at its end without any clean-up.
void run_and_kill(const std::function<void()>& action) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    action();
    ::raise(SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  ASSERT_EQ(WTERMSIG(status), SIGKILL);
}

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
    Store store = Store::create(file(), campaign_of(100), "");
    store.commit(deliveries_of(0, 10));
    store.for_each_result([](const RunResult&) { ::raise(SIGKILL); });
  });
  EXPECT_EQ(results_in(Store::open(file())).size(), 10u);
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

// A process killed in create() leaves such files; what they hold is of no interest.
TEST_F(StoreCrash, WhileCreatingIsRepairedByCreatingAgain) {
  test::write_file(file().concat(".new"), "half a database");
  test::write_file(file().concat(".new-journal"), "half a journal");
  test::write_file(file().concat(".lock"), "process 1 on nowhere\n");
  Store::create(file(), campaign_of(3), "");
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
  EXPECT_EQ(Store::open(file()).num_runs(), 3u);
}

/// While it lives, no file can grow beyond a size: to a program, much like a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t size) {
    ::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{.rlim_cur = size, .rlim_max = before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    ::signal(SIGXFSZ, SIG_DFL);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_{};
};

TEST_F(StoreCrash, OfTheDiskFailsTheCommitAndKeepsTheEarlierOnes) {
  Store store = Store::create(file(), campaign_of(5000), "");
  store.commit(deliveries_of(0, 100));
  {
    const FileSizeLimit limit(300'000);
    const std::string error = store_error_of([&] { store.commit(deliveries_of(100, 5000)); });
    EXPECT_EQ(error, "campaign file = " + file().string() +
                         " (disk I/O error; what was committed before is safe)");
    EXPECT_THAT(store.finished_runs(), ElementsAre(RunRange{RunIndex{0}, 100}));
  }
  EXPECT_EQ(store.commit(deliveries_of(100, 5000)).num_new, 4900u);
  EXPECT_THAT(store.finished_runs(), ElementsAre(RunRange{RunIndex{0}, 5000}));
}

TEST_F(StoreCrash, OfTheDiskWhileCreatingLeavesNoFile) {
  const FileSizeLimit limit(10'000);
  EXPECT_THAT(store_error_of([&] { Store::create(file(), campaign_of(1), ""); }),
              HasSubstr("(disk I/O error; "));
  EXPECT_TRUE(file_names().empty());
}

}  // namespace
}  // namespace proofmass::coordinator
