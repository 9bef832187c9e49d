// What opening a file costs and finds, and what is found later where a page is read.

#include <gmock/gmock.h>

#include <fstream>
#include <sstream>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/file_place.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using test::campaign_of;
using test::deliveries_of;
using test::store_error_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Bytes that this process has read so far, from files and caches alike.
std::uint64_t num_bytes_read() {
  std::ifstream stream("/proc/self/io");
  std::string name;
  std::uint64_t count = 0;
  stream >> name >> count;
  EXPECT_EQ(name, "rchar:");
  return count;
}

class StoreOpening : public test::StoreTest {
 protected:
  void fill(std::uint64_t num_runs) const {
    std::filesystem::remove(file());
    Store store = create(num_runs);
    store.write(std::vector<Entry>{worker_1()});
    store.commit(deliveries_of(0, num_runs));
  }
  static WorkerJoined worker_1() { return test::worker_1(); }

  /// Bytes that are read to open the file.
  template <typename Open>
  [[nodiscard]] static std::uint64_t cost_of(const Open& open) {
    const std::uint64_t before = num_bytes_read();
    open();
    return num_bytes_read() - before;
  }

  /// Overwrites a page of a table with zeros: its last one, or the root.
  void damage(const std::string& table, bool is_root) const {
    std::int64_t page = 0, page_size = 0;
    {
      const Database database(file(), Access::read_only);
      page = database.integer("SELECT rootpage FROM sqlite_schema WHERE name = '" + table + "'");
      page_size = database.integer("PRAGMA page_size");
    }
    std::fstream stream(file(), std::ios::binary | std::ios::in | std::ios::out);
    const auto start_of = [&](std::int64_t number) { return (number - 1) * page_size; };
    if (!is_root) {  // Bytes 8 to 11 of an inner page: its rightmost child.
      stream.seekg(start_of(page));
      ASSERT_EQ(stream.get(), 5) << table << " has one page";
      stream.seekg(start_of(page) + 8);
      page = 0;
      for (int i = 0; i < 4; ++i) page = page << 8 | stream.get();
    }
    stream.seekp(start_of(page));
    stream << std::string(static_cast<std::size_t>(page_size), '\0');
  }

  [[nodiscard]] std::string damaged() const {
    return message("is damaged: database disk image is malformed; restore it from a copy");
  }
};

TEST_F(StoreOpening, ForReadingCostsTheSameForAnyNumberOfRuns) {
  const auto read = [&] { Store::open_read_only(file()); };
  fill(1000);
  read();  // What is read once in a process.
  const std::uint64_t cost = cost_of(read);
  fill(20'000);
  ASSERT_GT(std::filesystem::file_size(file()), 4'000'000u);
  // Trees are a page or two deeper.
  constexpr std::uint64_t tolerance = 32 * 1024;
  EXPECT_LE(cost_of(read), cost + tolerance);
}

// Of a table that grows with the runs it is the first page.
TEST_F(StoreOpening, FindsADamagedRootOfAnyTable) {
  for (const std::string table : {"campaign", "parameter", "event", "summary", "tag", "run_result",
                                  "delivery", "attempt", "worker", "overrun"}) {
    fill(10);
    damage(table, true);
    EXPECT_EQ(store_error_of([&] { Store::open_read_only(file()); }), damaged()) << table;
  }
}

TEST_F(StoreOpening, LeavesAPageOfResultsToWhoeverReadsIt) {
  fill(2000);
  damage("run_result", false);
  const Store store = Store::open_read_only(file());
  const std::vector<std::function<void()>> readings{
      [&] { store.for_each_result([](const RunResult&) {}); },
      [&] { (void)test::results_in(store); }, [&] { store.check_integrity(); },
      [&] {
        ResultReader reader = store.results({RunIndex{1990}, 10});
        while (reader.next()) continue;
      }};
  for (const auto& read : readings) EXPECT_THAT(store_error_of(read), HasSubstr("is damaged: "));
  EXPECT_EQ(store.finished_runs().size(), 1u);
}

TEST_F(StoreOpening, LeavesAPageOfDeliveriesToWhoeverReadsIt) {
  fill(2000);
  damage("delivery", false);
  const Store store = Store::open_read_only(file());
  EXPECT_EQ(store_error_of([&] { (void)store.finished_runs(); }), damaged());
  EXPECT_EQ(test::results_in(store).size(), 2000u);
}

// It reads every delivery anyway, and writes.
TEST_F(StoreOpening, ForItsCoordinatorFindsAnyDamagedPageBeforeAnythingIsWritten) {
  for (const std::string table : {"run_result", "delivery"}) {
    fill(2000);
    damage(table, false);
    const std::string before = test::content_of(file());
    EXPECT_EQ(store_error_of([&] { Store::open(file()); }), damaged()) << table;
    EXPECT_TRUE(test::content_of(file()) == before) << table;
  }
}

TEST_F(StoreOpening, OfADamagedFileMakesNoBackup) {
  fill(2000);
  damage("run_result", false);
  const Store store = Store::open_read_only(file());
  EXPECT_EQ(store_error_of([&] { store.back_up(directory() / "copy.db"); }), damaged());
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

// The log is that of a coordinator that was killed, and then an older copy took the file's place.
TEST_F(StoreOpening, TellsThatALogBesideARestoredFileIsNotItsOwn) {
  const std::filesystem::path backup = directory() / "backup.db";
  create(4000).commit(deliveries_of(0, 1000));
  Store::open_read_only(file()).back_up(backup);
  Store::open(file()).commit(deliveries_of(1000, 2000));
  test::run_and_kill([&] {
    auto* const killed = new Store(Store::open(file()));  // Never closed.
    killed->commit(deliveries_of(2000, 3000));
  });
  std::filesystem::copy_file(backup, file(), std::filesystem::copy_options::overwrite_existing);
  const auto read = [&] {
    const Store store = Store::open_read_only(file());
    store.for_each_result([](const RunResult&) {});
    (void)store.finished_runs();
  };
  const std::string remedy =
      "; without its log campaign.db-wal it is in order: if the file was restored from a copy, the "
      "log is that of the file before it, and removing the log suffices)";
  EXPECT_THAT(store_error_of(read), HasSubstr(remedy));
  EXPECT_THAT(store_error_of([&] { Store::open(file()); }), HasSubstr(remedy));
  EXPECT_TRUE(test::content_of(file()) == test::content_of(backup));
  std::filesystem::remove(file().string() + "-wal");
  std::filesystem::remove(file().string() + "-shm");
  EXPECT_EQ(store_error_of(read), "");
  EXPECT_EQ(test::results_in(Store::open(file())).size(), 1000u);
}

TEST_F(StoreOpening, OfAFileThatIsDamagedWithoutItsLogNamesNoSuchRemedy) {
  fill(2000);
  damage("run_result", false);
  change("PRAGMA journal_mode = WAL");
  const Database keeps_the_log(file(), Access::read_only);
  change("UPDATE campaign SET priority = 1");
  const Store store = Store::open_read_only(file());
  EXPECT_EQ(store_error_of([&] { store.for_each_result([](const RunResult&) {}); }), damaged());
}

// Closing the file would fold the log in, which may not be its own.
TEST_F(StoreOpening, ForWritingFindsAnyDamagedPageOfAFileWithALog) {
  fill(2000);
  damage("run_result", false);
  change("PRAGMA journal_mode = WAL");
  const Database keeps_the_log(file(), Access::read_only);
  (void)keeps_the_log.count("SELECT num_runs FROM campaign");
  change("UPDATE campaign SET priority = 1");
  ASSERT_TRUE(detail::has_log(file()));
  const std::string before = test::content_of(file());
  EXPECT_EQ(store_error_of([&] { Store::open(file()); }), damaged());
  EXPECT_TRUE(test::content_of(file()) == before);
  EXPECT_TRUE(detail::has_log(file()));
}

}  // namespace
}  // namespace proofmass::coordinator
