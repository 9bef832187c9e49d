// When a campaign database is whole without its write-ahead log, and what is made of one that is
// not.

#include "coordinator/store/campaign_record.hpp"
#include "coordinator/store/detail/database.hpp"
#include "tests/coordinator/store/before_writes.hpp"
#include "tests/coordinator/store/writer_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using test::patient_config;

class StoreRest : public test::WriterTest {
 protected:
  /// A copy of the file alone, as `cp` makes it.
  [[nodiscard]] std::filesystem::path copy() const {
    const std::filesystem::path path = directory() / "copy.db";
    std::filesystem::remove(path);
    std::filesystem::remove(directory() / "copy.db-wal");
    std::filesystem::copy_file(file(), path);
    return path;
  }

  /// A symbolic link to the file, in another directory.
  [[nodiscard]] std::filesystem::path link() const {
    const std::filesystem::path folder = directory() / "links";
    if (std::filesystem::create_directory(folder)) {
      std::filesystem::create_symlink(file(), folder / "link.db");
    }
    return folder / "link.db";
  }

  /// Somebody in the middle of a table, who needs the state of the file as it is now.
  class Reader {
   public:
    explicit Reader(const std::filesystem::path& path)
        : database_(path, Access::read_only),
          select_(database_.prepare("SELECT 1 FROM parameter")) {
      EXPECT_TRUE(select_.step());
    }

   private:
    Database database_;
    detail::Statement select_;
  };

  [[nodiscard]] std::string lacks_its_log(const std::filesystem::path& path) const {
    return "campaign database = " + path.string() + " (lacks its log " + path.filename().string() +
           "-wal: results may be missing; copy both files, or make copies with `proofmass backup`; "
           "resuming the campaign computes what is missing)";
  }
};

TEST_F(StoreRest, ACopyWithoutTheLogOfACampaignThatGoesOnIsRefused) {
  Store store = create(64);
  store.commit(deliveries_of(0, 64));
  const std::filesystem::path alone = copy();
  EXPECT_EQ(test::store_error_of([&] { Store::open_read_only(alone); }), lacks_its_log(alone));
  EXPECT_EQ(test::store_error_of([&] { Store::open_read_only(alone); }), lacks_its_log(alone))
      << "the empty log that a reader makes is no log";
}

TEST_F(StoreRest, ACopyWithItsLogIsRead) {
  Store store = create(64);
  store.commit(deliveries_of(0, 64));
  const std::filesystem::path both = copy();
  std::filesystem::copy_file(file().string() + "-wal", both.string() + "-wal");
  EXPECT_EQ(results_in(Store::open_read_only(both)).size(), 64u);
}

// SQLite keeps the log beside the file that a symbolic link leads to.
TEST_F(StoreRest, AFileIsReadThroughALinkWithItsLog) {
  Store store = create(64);
  store.commit(deliveries_of(0, 64));
  EXPECT_EQ(results_in(Store::open_read_only(link())).size(), 64u);
  EXPECT_EQ(Store::open_read_only(link()).log_size(), store.log_size());
  EXPECT_TRUE(has_journal(link()));
  EXPECT_EQ(store.rest(), std::nullopt);
  EXPECT_FALSE(has_journal(link()));
}

TEST_F(StoreRest, ACampaignIsResumedThroughALinkWithItsLog) {
  { (void)create(64); }
  test::run_and_kill([&] {
    auto* const killed = new Store(Store::open(link()));  // Never closed.
    killed->commit(deliveries_of(0, 64));
  });
  const Store store = Store::open(link());
  EXPECT_EQ(test::event_kinds_in(file()), "");
  EXPECT_EQ(results_in(store).size(), 64u);
}

TEST_F(StoreRest, ACopyOfACampaignThatWentOnAfterItsRestIsRefused) {
  Store store = create(64);
  store.commit(deliveries_of(0, 32));
  EXPECT_EQ(store.rest(), std::nullopt);
  store.extend(campaign_of(100), "");
  const std::filesystem::path alone = copy();
  EXPECT_EQ(test::store_error_of([&] { Store::open_read_only(alone); }), lacks_its_log(alone));
}

// SQLite would remove a log of which all is in the file; the mark in the file says that it is
// needed.
TEST_F(StoreRest, AFileWhoseMarkCannotBeClearedKeepsItsLog) {
  {
    std::optional<Store> store = create(64);
    store->commit(deliveries_of(0, 64));
    change("PRAGMA wal_checkpoint(PASSIVE)");
    const test::FileSizeLimit full(0);
    EXPECT_THAT(test::store_error_of([&] { (void)store->rest(); }), HasSubstr("disk I/O error"));
    store.reset();
  }
  EXPECT_EQ(results_in(Store::open_read_only(file())).size(), 64u);
  { (void)Store::open(file()); }
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
  EXPECT_EQ(results_in(Store::open_read_only(file())).size(), 64u);
}

TEST_F(StoreRest, ACoordinatorGoesOnWithoutTheLogAndSaysSo) {
  Store store = create(64);
  store.commit(deliveries_of(0, 10));
  ASSERT_EQ(store.rest(), std::nullopt);
  store.commit(deliveries_of(10, 64));
  const std::filesystem::path alone = copy();
  {
    Store resumed = Store::open(alone);
    EXPECT_THAT(resumed.finished_runs(), ElementsAre(RunRange{RunIndex{0}, 10}));
    resumed.commit(deliveries_of(0, 64));
  }
  EXPECT_EQ(results_in(Store::open_read_only(alone)).size(), 64u);
  { (void)Store::open(alone); }
  EXPECT_EQ(test::event_kinds_in(alone), "log_lost") << "said once";
}

// Whatever write the process dies before: the file with its log has everything, and the file alone
// has everything or says that it lacks its log. With one result at a time most rounds need no new
// page, so that a file of which only some pages are written has the right length.
TEST_F(StoreRest, NoWriteLeavesACopyThatPassesAsWholeAndIsNot) {
  Store store = create(1000);
  std::uint64_t num_stored = 0, num_copies = 0, num_whole = 0;
  const test::BeforeWrites copies([&] {
    const std::filesystem::path alone = copy();
    ++num_copies;
    const std::string error = test::store_error_of([&] {
      EXPECT_GE(results_in(Store::open_read_only(alone)).size(), num_stored);
      ++num_whole;
    });
  });
  for (int round = 0; round < 40; ++round) {
    store.commit(deliveries_of(num_stored, num_stored + 1));
    ++num_stored;
    EXPECT_EQ(store.rest(), std::nullopt);
  }
  EXPECT_GT(num_whole, 40u);
  EXPECT_GT(num_copies, 100u);
}

TEST_F(StoreRest, TheWriterBringsAFileToRestOnceAllIsWritten) {
  StoreWriter& writer = serve(100);
  write_runs(0, 100);
  writer.rest(id);
  writer.flush();
  EXPECT_EQ(results_in(Store::open_read_only(copy())).size(), 100u);
  // An event is written, and the file comes to rest again.
  writer.write(id, EventEntry{.kind = "later", .text = ""});
  writer.write({}, EventEntry{.kind = "for those not at rest", .text = ""});
  writer.flush();
  const std::filesystem::path alone = copy();
  EXPECT_EQ(test::event_kinds_in(alone), "later");
  EXPECT_EQ(test::text_in(alone, "SELECT is_log_needed FROM campaign"), "0");
  EXPECT_THAT(take_completions(), Not(Contains("write_ahead_log_kept")));
}

TEST_F(StoreRest, TheWriterSaysThatAReaderKeepsTheLogAndWhenItIsFolded) {
  WriterConfig config = patient_config();
  config.commit_after = std::chrono::milliseconds(1);
  config.retry_after = std::chrono::milliseconds(1);
  StoreWriter& writer = serve(100, config);
  {
    const Reader reader(file());
    writer.write(id, delivery_of(1));
    writer.rest(id);
    wait_for("write_ahead_log_kept");
  }
  const std::vector<std::string> texts = wait_for("write_ahead_log_folded");
  EXPECT_THAT(texts, Not(Contains("write_ahead_log_kept")));
  EXPECT_EQ(results_in(Store::open_read_only(copy())).size(), 1u);
}

// As an answer to whoever waited for the campaign is.
TEST_F(StoreRest, TheWriterDoesNotSpeakOfAShortReader) {
  StoreWriter& writer = serve(100);
  {
    const Reader reader(file());
    writer.write(id, delivery_of(1));
    writer.rest(id);
    writer.flush();
    EXPECT_EQ(test::text_in(file(), "SELECT is_log_needed FROM campaign"), "1");
  }
  writer.flush();
  EXPECT_EQ(results_in(Store::open_read_only(copy())).size(), 1u);
  EXPECT_THAT(take_completions(), Not(Contains("write_ahead_log_kept")));
}

TEST_F(StoreRest, EndsForTheWriterWithTheNextResult) {
  StoreWriter& writer = serve(100);
  writer.rest(id);
  writer.flush();
  writer.write(id, delivery_of(1));
  writer.write({}, EventEntry{.kind = "for those not at rest", .text = ""});
  writer.flush();
  const std::filesystem::path alone = copy();
  EXPECT_EQ(test::store_error_of([&] { Store::open_read_only(alone); }), lacks_its_log(alone));
  EXPECT_EQ(test::event_kinds_in(file()), "for those not at rest");
}

}  // namespace
}  // namespace proofmass::coordinator
