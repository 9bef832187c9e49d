#include "coordinator/store/detail/store_lock.hpp"

#include <gmock/gmock.h>

#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator::detail {
namespace {

using test::store_error_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using StoreLockTest = test::StoreTest;

TEST_F(StoreLockTest, IsHeldByOne) {
  const StoreLock lock(file());
  EXPECT_THAT(store_error_of([&] { const StoreLock second(file()); }),
              HasSubstr("(held by process " + std::to_string(::getpid()) + " on "));
}

TEST_F(StoreLockTest, IsFreeAfterItsHolderAndLeavesNoFile) {
  { const StoreLock lock(file()); }
  EXPECT_TRUE(file_names().empty());
  const StoreLock lock(file());
  EXPECT_THAT(file_names(), ElementsAre("campaign.db.lock"));
}

TEST_F(StoreLockTest, IgnoresAFileThatACrashLeftBehind) {
  test::write_file(file().concat(".lock"), "process 1 on nowhere\n");
  const StoreLock lock(file());
  EXPECT_THAT(store_error_of([&] { const StoreLock second(file()); }),
              HasSubstr("held by process " + std::to_string(::getpid()) + " on "));
}

TEST_F(StoreLockTest, IsOneForAllNamesOfAFile) {
  test::write_file(file(), "");
  std::filesystem::create_symlink(file(), directory() / "alias.db");
  const StoreLock lock(file());
  EXPECT_NE(store_error_of([&] { const StoreLock second(directory() / "alias.db"); }), "");
}

TEST_F(StoreLockTest, NamesNobodyIfTheHolderLeftNoName) {
  const StoreLock lock(file());
  test::write_file(file().concat(".lock"), "");
  EXPECT_THAT(store_error_of([&] { const StoreLock second(file()); }),
              HasSubstr("(held by another process; "));
}

}  // namespace
}  // namespace proofmass::coordinator::detail
