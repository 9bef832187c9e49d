#include <fmt/format.h>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/file_place.hpp"
#include "coordinator/store/records.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

// What opening a file costs and finds, and what is found later where a page is read.

using detail::Access;
using detail::Database;

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

  // Where the damage is depends on how SQLite packs pages.
  [[nodiscard]] static auto damaged() {
    return HasSubstr("is damaged: database disk image is malformed; PRAGMA integrity_check: ");
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
    EXPECT_THAT(store_error_of([&] { Store::open_read_only(file()); }), damaged()) << table;
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
  EXPECT_THAT(store_error_of([&] { (void)store.finished_runs(); }), damaged());
  EXPECT_EQ(test::results_in(store).size(), 2000u);
}

// It reads every delivery anyway, and writes.
TEST_F(StoreOpening, ForItsCoordinatorFindsAnyDamagedPageBeforeAnythingIsWritten) {
  for (const std::string table : {"run_result", "delivery"}) {
    fill(2000);
    damage(table, false);
    const std::string before = test::content_of(file());
    EXPECT_THAT(store_error_of([&] { Store::open(file()); }), damaged()) << table;
    EXPECT_TRUE(test::content_of(file()) == before) << table;
  }
}

TEST_F(StoreOpening, OfADamagedFileMakesNoBackup) {
  fill(2000);
  damage("run_result", false);
  const Store store = Store::open_read_only(file());
  EXPECT_THAT(store_error_of([&] { store.back_up(directory() / "copy.db"); }), damaged());
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
  EXPECT_THAT(store_error_of([&] { store.for_each_result([](const RunResult&) {}); }), damaged());
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
  EXPECT_THAT(store_error_of([&] { Store::open(file()); }), damaged());
  EXPECT_TRUE(test::content_of(file()) == before);
  EXPECT_TRUE(detail::has_log(file()));
}

using test::lost_runs;
using test::result_of;
using test::session_1;

class CampaignHistoryTest : public test::StoreTest {
 protected:
  CampaignHistoryTest() : store(create(100)) { write({test::worker_1()}); }
  void write(const std::vector<Entry>& entries) { (void)store.write(entries); }

  static Delivery failed(std::uint64_t run, RunStatus status) {
    Delivery delivery = delivery_of(run);
    delivery.result = result_of(run, status);
    return delivery;
  }

  Store store;
};

TEST_F(CampaignHistoryTest, HasTheEventsAfterOne) {
  for (int i = 0; i < 5; ++i) store.record_event("event", fmt::format("number {}", i));
  const Store history = Store::open_read_only(file());
  const std::vector<StoredEvent> all = history.events_after(0, 100);
  ASSERT_EQ(all.size(), 5U);
  EXPECT_EQ(all[0].text, "number 0");
  EXPECT_EQ(all[4].kind, "event");
  const std::vector<StoredEvent> some = history.events_after(all[2].id, 100);
  ASSERT_EQ(some.size(), 2U);
  EXPECT_EQ(some[0].text, "number 3");
  // The newest ones if there are too many.
  EXPECT_EQ(history.events_after(0, 2)[0].text, "number 3");
  store.record_event("event", "later");
  EXPECT_EQ(history.events_after(all[4].id, 100)[0].text, "later");
}

TEST_F(CampaignHistoryTest, CountsLossesByReasonAndBlame) {
  write({lost_runs(0, 10, wire::LossReason::silent, false),
         lost_runs(10, 5, wire::LossReason::silent, false),
         lost_runs(20, 1, wire::LossReason::crashed, true),
         lost_runs(21, 2, wire::LossReason::crashed, false)});
  const auto in_words = [](const std::vector<LossCount>& losses) {
    std::string words;
    for (const LossCount& loss : losses) {
      words +=
          fmt::format("{} {} {} {};", loss.reason, loss.num_losses, loss.num_runs, loss.num_blamed);
    }
    return words;
  };
  EXPECT_EQ(in_words(Store::open_read_only(file()).losses()), "silent 2 15 0;crashed 2 3 1;");
  EXPECT_EQ(in_words(store.execution().losses), "silent 2 15 0;crashed 1 2 0;crashed 1 1 1;");
}

TEST_F(CampaignHistoryTest, CountsHowRunsEndedWithoutAnEstimate) {
  write({delivery_of(0), failed(1, RunStatus::not_converged), failed(2, RunStatus::not_finite),
         failed(3, RunStatus::no_draw), failed(4, RunStatus::no_draw)});
  const std::vector<EndCount> ends = Store::open_read_only(file()).ends_without_estimate();
  ASSERT_EQ(ends.size(), 3U);
  EXPECT_EQ(ends[0].status, "no draw");
  EXPECT_EQ(ends[0].num_runs, 2U);
  EXPECT_EQ(ends[1].status, "not converged");
  EXPECT_EQ(ends[2].status, "not finite");
  EXPECT_EQ(ends[2].num_runs, 1U);
  EXPECT_EQ(ends[2].cause, "");
}

TEST_F(CampaignHistoryTest, NamesRunsThatWereGivenUp) {
  for (const std::uint64_t run : {7U, 3U, 5U}) {
    write({lost_runs(run, 1, wire::LossReason::crashed, true), GivenUpRun{{run}}});
  }
  const std::vector<GivenUpRecord> runs = Store::open_read_only(file()).given_up_records(2);
  ASSERT_EQ(runs.size(), 2U);
  EXPECT_EQ(runs[0].run.value, 3U);
  EXPECT_EQ(runs[1].run.value, 5U);
  EXPECT_EQ(runs[0].reason, "crashed");
  EXPECT_EQ(runs[0].num_attempts, 1U);
}

// Three runs of one batch share its time; a fourth one was computed by itself.
TEST_F(CampaignHistoryTest, JoinsTheRunsOfABatch) {
  std::vector<Entry> entries;
  for (const std::uint64_t run : {4U, 5U, 6U}) entries.emplace_back(delivery_of(run));
  Delivery single = delivery_of(9);
  single.compute_s = 2.0;
  entries.emplace_back(single);
  write(entries);
  change("UPDATE delivery SET received_unix_s = 2000");
  const RecentAttempts attempts = Store::open_read_only(file()).recent_attempts(100, 100);
  ASSERT_EQ(attempts.computed.size(), 2U);
  EXPECT_EQ(attempts.computed[0].num_runs, 3U);
  EXPECT_EQ(attempts.computed[0].first, RunIndex{4});
  EXPECT_EQ(attempts.computed[0].last, RunIndex{6});
  EXPECT_DOUBLE_EQ(attempts.computed[0].compute_s, 1.5);
  EXPECT_EQ(attempts.computed[0].unix_s, 2000U);
  EXPECT_EQ(attempts.computed[0].worker, "worker-1");
  EXPECT_EQ(attempts.computed[1].num_runs, 1U);
  EXPECT_EQ(attempts.computed[1].first, RunIndex{9});
}

TEST_F(CampaignHistoryTest, HasTheNewestAttemptsAndCountsTheOthers) {
  std::vector<Entry> entries;
  for (std::uint64_t run = 0; run < 20; ++run) entries.emplace_back(delivery_of(run));
  for (std::uint64_t i = 0; i < 5; ++i) {
    entries.emplace_back(lost_runs(50 + i, 1, wire::LossReason::silent, false));
  }
  write(entries);
  change("UPDATE delivery SET received_unix_s = 1000 + run_index");
  const RecentAttempts attempts = Store::open_read_only(file()).recent_attempts(8, 2);
  EXPECT_EQ(attempts.num_runs_left_out, 12U);
  ASSERT_EQ(attempts.computed.size(), 8U);
  EXPECT_EQ(attempts.computed.front().first.value, 19U);
  EXPECT_EQ(attempts.computed.back().first.value, 12U);
  ASSERT_EQ(attempts.lost.size(), 2U);
  EXPECT_EQ(attempts.lost[0].first.value, 54U);
}

/// A campaign whose workers, results and losses are known.
class StoreExecution : public test::StoreTest {
 protected:
  static constexpr wire::SessionId second_worker{2}, third_worker{3};

  StoreExecution() : store(create(100)) {
    const auto worker = [](wire::SessionId session, const std::string& host,
                           const std::string& cards = "") {
      return WorkerJoined{.session = session, .name = "w", .host = host, .cards = cards};
    };
    write({worker(session_1, "node-1", "2 A100"), worker(second_worker, "node-1", "2 A100"),
           worker(third_worker, "node-2")});
  }
  void write(const std::vector<Entry>& entries) { (void)store.write(entries); }

  static Delivery computed(std::uint64_t run, wire::SessionId worker, std::uint32_t attempt,
                           double compute_s) {
    Delivery delivery = delivery_of(run);
    delivery.worker = worker;
    delivery.attempt = {attempt};
    delivery.compute_s = compute_s;
    return delivery;
  }

  Store store;
};

TEST_F(StoreExecution, OfANewCampaignIsEmpty) {
  const CampaignExecution execution =
      Store::create(directory() / "new.db", test::campaign_of(5), "definition").execution();
  EXPECT_EQ(execution.num_workers, 0U);
  EXPECT_EQ(execution.compute_s, 0.0);
  EXPECT_TRUE(execution.hosts.empty());
  EXPECT_TRUE(execution.losses.empty());
  EXPECT_EQ(execution.first_result_utc, "");
}

TEST_F(StoreExecution, SaysWhoComputedTheResultsAndWhen) {
  write({computed(0, session_1, 1, 0.5), computed(1, second_worker, 1, 1.0),
         computed(2, second_worker, 2, 2.0), computed(3, third_worker, 3, 4.0)});
  store.begin_coordinator({.epoch = {1}, .host = "login", .process_id = 7, .version = "v"});
  store.begin_coordinator({.epoch = {2}, .host = "login", .process_id = 8, .version = "v"});
  Delivery wrong = test::wrong_delivery_of(1);
  wrong.worker = third_worker;
  write({SecondDelivery{computed(0, third_worker, 1, 0.5)}, SecondDelivery{wrong}});
  test::change(file(), "UPDATE delivery SET received_unix_s = 86400 + 3600 * run_index");
  test::change(file(),
               "UPDATE worker SET first_seen_utc = '1970-01-02T00:00:10Z',"
               " last_result_unix_s = 86420 + worker_key");
  const CampaignExecution execution = store.execution();
  EXPECT_EQ(execution.num_audited, 2U);
  EXPECT_EQ(store.num_contradicting(), 1U);
  EXPECT_EQ(execution.first_result_utc, "1970-01-02T00:00:00Z");
  EXPECT_EQ(execution.last_result_utc, "1970-01-02T03:00:00Z");
  EXPECT_EQ(execution.num_coordinators, 2U);
  EXPECT_EQ(execution.num_workers, 3U);
  EXPECT_EQ(execution.num_hosts, 2U);
  EXPECT_EQ(execution.compute_s, 7.5);
  EXPECT_EQ(execution.num_retried, 2U);
  ASSERT_EQ(execution.hosts.size(), 2U);
  EXPECT_EQ(execution.hosts[0].host, "node-1");
  EXPECT_EQ(execution.hosts[0].num_workers, 2U);
  EXPECT_EQ(execution.hosts[0].num_results, 3U);
  EXPECT_EQ(execution.hosts[0].compute_s, 3.5);
  EXPECT_EQ(execution.hosts[0].serving_s, 12.0);
  EXPECT_EQ(execution.hosts[0].cards, "2 A100");
  EXPECT_EQ(execution.hosts[1].host, "node-2");
  EXPECT_EQ(execution.hosts[1].compute_s, 4.0);
  EXPECT_EQ(execution.hosts[1].cards, "");
}

}  // namespace
}  // namespace proofmass::coordinator
