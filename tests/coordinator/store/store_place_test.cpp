// Files that lose their name while they are open: removed, renamed, replaced, without their log.

#include <gmock/gmock.h>

#include <utility>

#include "coordinator/store/detail/file_place.hpp"
#include "tests/coordinator/store/before_writes.hpp"
#include "tests/coordinator/store/writer_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using test::campaign_of;
using test::deliveries_of;
using test::delivery_of;
using test::results_in;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class StorePlace : public test::WriterTest {
 protected:
  /// Hands results over and waits until the writer has tried to store them.
  void deliver(StoreWriter& writer, std::uint64_t first, std::uint64_t end) const {
    for (std::uint64_t run = first; run < end; ++run) writer.deliver(id, delivery_of(run));
    writer.flush();
  }
  /// What a reader finds under the name: that many results, and a file that is in order.
  [[nodiscard]] std::size_t num_readable() const {
    const Store store = Store::open_read_only(file());
    store.check_integrity();
    return results_in(store).size();
  }
  [[nodiscard]] std::filesystem::path backup() const { return directory() / "backup.db"; }

  /// Renames the file to backup() and puts that of another campaign in its place.
  void replace_by_another() const {
    const std::filesystem::path other = directory() / "other.db";
    { (void)Store::create(other, campaign_of(7), ""); }
    std::filesystem::rename(file(), backup());
    std::filesystem::rename(other, file());
  }
  [[nodiscard]] static std::string error_of_rest(Store& store) {
    return test::store_error_of([&] { (void)store.rest(); });
  }
};

TEST_F(StorePlace, AFileThatWasRemovedIsWrittenAgainBeforeAResultIsNamed) {
  StoreWriter& writer = start();
  writer.open(id, create());
  deliver(writer, 0, 10);
  std::filesystem::remove(file());
  deliver(writer, 10, 20);
  EXPECT_THAT(take_completions(), Contains("restored"));
  EXPECT_EQ(num_readable(), 20u);
  deliver(writer, 20, 30);
  EXPECT_EQ(num_readable(), 30u);
  end();
  EXPECT_EQ(num_readable(), 30u);
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

// No look before the commit can see it.
TEST_F(StorePlace, AFileThatIsRemovedInTheMidstOfACommitIsWrittenAgain) {
  StoreWriter& writer = start();
  writer.open(id, create());
  deliver(writer, 0, 10);
  (void)take_completions();
  {
    bool is_removed = false;  // The copy that takes its place stays.
    const test::BeforeWrites removal([&] {
      if (!std::exchange(is_removed, true)) std::filesystem::remove(file());
    });
    deliver(writer, 10, 12);
  }
  EXPECT_THAT(take_completions(), ElementsAre("restored", test::committed({10, 11})));
  EXPECT_EQ(num_readable(), 12u);
}

TEST_F(StorePlace, AFileThatWasRemovedWithAllBesideItIsWrittenAgain) {
  StoreWriter& writer = start();
  writer.open(id, create());
  deliver(writer, 0, 10);
  for (const std::string& name : file_names()) std::filesystem::remove(directory() / name);
  deliver(writer, 10, 20);
  EXPECT_EQ(num_readable(), 20u);
  EXPECT_EQ(test::store_error_of([&] { Store::open(file()); }).substr(0, 7), "lock = ");
  end();
  EXPECT_EQ(num_readable(), 20u);
}

TEST_F(StorePlace, ARunIsStoredOnceThoughItsCommitWasInDoubt) {
  StoreWriter& writer = start();
  writer.open(id, create());
  deliver(writer, 0, 10);
  std::filesystem::remove(file());
  deliver(writer, 10, 20);
  EXPECT_EQ(test::text_in(file(), "SELECT count(*) FROM audit"), "0");
}

TEST_F(StorePlace, AnOlderCopyInItsPlaceIsBroughtUpToDate) {
  StoreWriter& writer = start();
  writer.open(id, create());
  deliver(writer, 0, 10);
  Store::open_read_only(file()).back_up(backup());
  deliver(writer, 10, 20);
  writer.access(id, [](Store& store) { store.extend(campaign_of(200), ""); });
  std::filesystem::rename(backup(), file());
  deliver(writer, 20, 30);
  EXPECT_THAT(take_completions(), Contains("replaced"));
  EXPECT_EQ(num_readable(), 30u);
  EXPECT_EQ(Store::open_read_only(file()).num_runs(), 200u);
  end();
  EXPECT_EQ(num_readable(), 30u);
}

// It was served elsewhere, and its coordinator killed: it has its own log.
TEST_F(StorePlace, AnOlderCopyWithItsOwnLogIsBroughtUpToDate) {
  StoreWriter& writer = start();
  writer.open(id, create());
  deliver(writer, 0, 10);
  Store::open_read_only(file()).back_up(backup());
  test::run_and_kill([&] {
    auto* const killed = new Store(Store::open(backup()));  // Never closed.
    killed->commit(deliveries_of(5, 15));
  });
  ASSERT_TRUE(detail::has_log(backup()));
  deliver(writer, 10, 20);
  std::filesystem::rename(backup(), file());
  std::filesystem::rename(detail::log_path(backup()), detail::log_path(file()));
  std::filesystem::remove(backup().string() + "-shm");
  std::filesystem::remove(file().string() + "-shm");
  deliver(writer, 20, 30);
  EXPECT_EQ(num_readable(), 30u);
}

TEST_F(StorePlace, AnotherFileInItsPlaceIsLeftAloneAndNothingIsLost) {
  StoreWriter& writer = start();
  writer.open(id, create());
  deliver(writer, 0, 10);
  (void)take_completions();
  { (void)Store::create(backup(), campaign_of(7), ""); }
  std::filesystem::rename(backup(), file());
  deliver(writer, 10, 20);
  deliver(writer, 20, 30);
  EXPECT_THAT(take_completions(), ElementsAre(HasSubstr("is of another campaign")));
  EXPECT_EQ(Store::open_read_only(file()).num_runs(), 7u);
  std::filesystem::remove(file());
  writer.flush();
  EXPECT_THAT(take_completions(), Contains("recovered"));
  EXPECT_EQ(num_readable(), 30u);
}

// The log, which goes by the name, may hold the only copy of what workers were told to be safe.
TEST_F(StorePlace, AKilledCoordinatorLeavesAllResultsInAFileWhoseNameAnotherHas) {
  test::run_and_kill([&] {
    auto* const killed = new Store(create());  // Never closed.
    killed->commit(deliveries_of(0, 10));
    replace_by_another();
    (void)error_of_rest(*killed);
  });
  std::filesystem::rename(backup(), file());
  EXPECT_EQ(num_readable(), 10u);
  const Store store = Store::open(file());
  EXPECT_FALSE(store.has_lost_its_log());
  EXPECT_EQ(results_in(store).size(), 10u);
}

TEST_F(StorePlace, AFileThatIsClosedWhileAnotherHasItsNameHasAllResults) {
  {
    Store store = create();
    store.commit(deliveries_of(0, 10));
    replace_by_another();
  }
  EXPECT_EQ(Store::open_read_only(file()).num_runs(), 7u);
  EXPECT_EQ(results_in(Store::open_read_only(backup())).size(), 10u);
}

TEST_F(StorePlace, AFileThatIsClosedWithoutItsDirectoryHasAllResults) {
  const std::filesystem::path folder = directory() / "folder";
  const std::filesystem::path moved = directory() / "moved";
  std::filesystem::create_directory(folder);
  {
    Store store = Store::create(folder / "campaign.db", campaign_of(100), "");
    store.commit(deliveries_of(0, 10));
    std::filesystem::rename(folder, moved);
  }
  std::filesystem::copy_file(moved / "campaign.db", file());
  EXPECT_EQ(num_readable(), 10u);
}

TEST_F(StorePlace, ALogThatAReaderNeedsIsKeptWhileAnotherFileHasTheName) {
  Store store = create();
  store.commit(deliveries_of(0, 10));
  const Store reader = Store::open_read_only(file());
  reader.read_one_state([&] {
    (void)reader.num_runs();
    store.commit(deliveries_of(10, 20));
    replace_by_another();
    EXPECT_THAT(error_of_rest(store), HasSubstr("is of another campaign"));
    EXPECT_TRUE(detail::has_log(file()));
  });
  std::filesystem::rename(backup(), file());
  EXPECT_EQ(store.rest(), std::nullopt);
  EXPECT_EQ(num_readable(), 20u);
}

TEST_F(StorePlace, AnOlderCopyIsBroughtUpToDateThoughAReaderNeedsTheLog) {
  Store store = create();
  store.commit(deliveries_of(0, 10));
  const Store reader = Store::open_read_only(file());
  reader.back_up(backup());
  reader.read_one_state([&] {
    (void)reader.num_runs();
    store.commit(deliveries_of(10, 20));
    std::filesystem::rename(backup(), file());
    EXPECT_EQ(error_of_rest(store), "");
    EXPECT_EQ(num_readable(), 20u);
  });
}

// Neither the fold nor the copy fits.
TEST_F(StorePlace, TheLogOfARenamedFileIsKeptOnAFullDisk) {
  Store store = create(2000);
  store.commit(deliveries_of(0, 1000));
  std::filesystem::rename(file(), backup());
  {
    const test::FileSizeLimit limit(150'000);  // More than a new campaign database needs.
    EXPECT_NE(error_of_rest(store), "");
    EXPECT_TRUE(detail::has_log(file()));
  }
  EXPECT_EQ(error_of_rest(store), "");
  EXPECT_EQ(num_readable(), 1000u);
}

TEST_F(StorePlace, ACopyWithAnotherResultIsLeftAlone) {
  StoreWriter& writer = start();
  writer.open(id, create());
  deliver(writer, 0, 10);
  Store::open_read_only(file()).back_up(backup());
  { Store::open(backup()).commit(deliveries_of(50, 51)); }
  std::filesystem::rename(backup(), file());
  deliver(writer, 10, 20);
  EXPECT_THAT(take_completions(), Contains(HasSubstr("has another result of run 50")));
}

TEST_F(StorePlace, WhatIsNoDatabaseInItsPlaceIsLeftAlone) {
  StoreWriter& writer = start();
  writer.open(id, create());
  std::filesystem::remove(file());
  test::write_file(file(), std::string(10'000, 'x'));
  deliver(writer, 0, 10);
  EXPECT_THAT(take_completions(), Contains(HasSubstr("is not an SQLite database")));
  std::filesystem::remove(file());
  writer.flush();
  EXPECT_EQ(num_readable(), 10u);
}

TEST_F(StorePlace, AFileThatIsRenamedAndComesBackGoesOn) {
  StoreWriter& writer = start();
  writer.open(id, create());
  deliver(writer, 0, 10);
  std::filesystem::rename(file(), backup());
  deliver(writer, 10, 20);
  EXPECT_EQ(num_readable(), 20u);
  std::filesystem::rename(backup(), file());  // An older state, without its log.
  deliver(writer, 20, 30);
  EXPECT_EQ(num_readable(), 30u);
}

TEST_F(StorePlace, AFileWhoseDirectoryIsRenamedWaitsForIt) {
  const std::filesystem::path folder = directory() / "folder";
  std::filesystem::create_directory(folder);
  StoreWriter& writer = start();
  writer.open(id, Store::create(folder / "campaign.db", campaign_of(100), ""));
  deliver(writer, 0, 10);
  (void)take_completions();
  std::filesystem::rename(folder, directory() / "moved");
  deliver(writer, 10, 20);
  EXPECT_THAT(take_completions(), ElementsAre(HasSubstr("lost its directory")));
  std::filesystem::rename(directory() / "moved", folder);
  writer.flush();
  EXPECT_THAT(take_completions(), Contains("recovered"));
  EXPECT_EQ(results_in(Store::open_read_only(folder / "campaign.db")).size(), 20u);
}

TEST_F(StorePlace, ARemovedLogIsMadeAnew) {
  StoreWriter& writer = start();
  writer.open(id, create());
  deliver(writer, 0, 10);
  std::filesystem::remove(detail::log_path(file()));
  deliver(writer, 10, 20);
  EXPECT_THAT(take_completions(), Contains("log made anew"));
  EXPECT_EQ(num_readable(), 20u);
}

TEST_F(StorePlace, AnIdleFileIsLookedAt) {
  WriterConfig config = test::patient_config();
  config.look_after = std::chrono::milliseconds(1);
  StoreWriter& writer = start(config);
  writer.open(id, create());
  deliver(writer, 0, 10);
  std::filesystem::remove(file());
  wait_for("restored");
  EXPECT_EQ(num_readable(), 10u);
}

// What was cut off cannot be had back; nothing more is stored, or named as stored.
TEST_F(StorePlace, AFileThatIsTruncatedIsNamedAtOnceAndLeftAlone) {
  StoreWriter& writer = start();
  writer.open(id, create());
  deliver(writer, 0, 10);
  (void)take_completions();
  std::filesystem::resize_file(file(), 4096);
  writer.flush();
  EXPECT_THAT(take_completions(), ElementsAre(HasSubstr("was truncated or written over")));
  std::filesystem::resize_file(file(), 1 << 20);  // The hole does not bring it back.
  deliver(writer, 10, 20);
  EXPECT_THAT(take_completions(), testing::IsEmpty());
  std::filesystem::resize_file(file(), 4096);
  end();
  EXPECT_EQ(std::filesystem::file_size(file()), 4096U);
}

TEST_F(StorePlace, AFileThatIsClosedWithoutItsNameGetsItBack) {
  {
    Store store = Store::create(file(), campaign_of(100), "");
    store.commit(deliveries_of(0, 10));
    std::filesystem::remove(file());
  }
  EXPECT_EQ(num_readable(), 10u);
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

TEST_F(StorePlace, WhoeverClosesAFileLearnsThatItIsLost) {
  Store store = Store::create(file(), campaign_of(100), "");
  store.commit(deliveries_of(0, 10));
  std::filesystem::remove(file());
  std::filesystem::create_directory(file());
  EXPECT_THAT(test::store_error_of([&] { (void)store.rest(); }), HasSubstr("campaign database = "));
}

// The connection to the lost file must not touch the log of what has its name now.
TEST_F(StorePlace, ClosingALostFileLeavesTheFileInItsPlaceAsItIs) {
  {
    Store store = Store::create(file(), campaign_of(100), "");
    store.commit(deliveries_of(0, 10));
    { (void)Store::create(backup(), campaign_of(7), ""); }
    test::run_and_kill([&] {
      auto* const killed = new Store(Store::open(backup()));  // Never closed.
      killed->record_event("other", "");
    });
    std::filesystem::rename(backup(), file());
    std::filesystem::rename(detail::log_path(backup()), detail::log_path(file()));
    std::filesystem::rename(backup().string() + "-shm", file().string() + "-shm");
  }
  ASSERT_TRUE(detail::has_log(file()));
  EXPECT_EQ(test::event_kinds_in(file()), "other");
}

// A second hard link endangers nothing that is stored: under either name the file is refused to a
// second coordinator, which the first one's lock of the file itself keeps away as well.
TEST_F(StorePlace, AnotherNameOfTheFileChangesNothing) {
  StoreWriter& writer = start();
  writer.open(id, create());
  deliver(writer, 0, 10);
  std::filesystem::create_hard_link(file(), directory() / "second.db");
  deliver(writer, 10, 20);
  EXPECT_THAT(take_completions(), Not(Contains(HasSubstr("failed"))));
  EXPECT_NE(test::store_error_of([&] { Store::open(directory() / "second.db"); }), "");
  std::filesystem::remove(file());
  deliver(writer, 20, 30);
  EXPECT_EQ(num_readable(), 30u);
}

TEST_F(StorePlace, KeepsASecondCoordinatorAwayThoughBothLockFilesWereRemoved) {
  Store first = Store::create(file(), campaign_of(100), "");
  first.commit(deliveries_of(0, 10));
  std::filesystem::remove(file().string() + ".lock");
  EXPECT_EQ(test::store_error_of([&] { Store::open(file()); }),
            "campaign database = " + file().string() +
                " (another coordinator has it; a campaign has one coordinator at a time)");
  first.commit(deliveries_of(10, 20));
  EXPECT_EQ(num_readable(), 20u);
}

}  // namespace
}  // namespace proofmass::coordinator
