// Files that lose their name while they are open: removed, renamed, replaced, without their log.
// Nothing more is stored, and a copy beside the name has all that was stored before.

#include "coordinator/store/detail/file_place.hpp"
#include "tests/coordinator/store/before_writes.hpp"
#include "tests/coordinator/store/writer_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

class StorePlace : public test::WriterTest {
 protected:
  /// Hands results over and waits until the writer has tried to store them.
  void deliver(StoreWriter& writer, std::uint64_t first, std::uint64_t end) const {
    for (std::uint64_t run = first; run < end; ++run) writer.write(id, delivery_of(run));
    writer.flush();
  }
  /// What a reader finds in a file: that many results, and all in order.
  [[nodiscard]] static std::size_t num_readable(const std::filesystem::path& path) {
    const Store store = Store::open_read_only(path);
    store.check_integrity();
    return results_in(store).size();
  }
  [[nodiscard]] std::filesystem::path backup() const { return directory() / "backup.db"; }

  /// The copies that were made in a directory.
  [[nodiscard]] static std::vector<std::filesystem::path> copies_in(
      const std::filesystem::path& folder) {
    std::vector<std::filesystem::path> copies;
    for (const auto& item : std::filesystem::directory_iterator(folder)) {
      const bool is_copy = item.path().filename().string().starts_with("campaign.recovered-");
      if (is_copy && item.path().extension() == ".db") copies.push_back(item.path());
    }
    return copies;
  }
  /// The only copy.
  [[nodiscard]] std::filesystem::path copy() const {
    const std::vector<std::filesystem::path> copies = copies_in(directory());
    EXPECT_THAT(copies, SizeIs(1));
    return copies.empty() ? file() : copies.front();
  }

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

  /// Whatever happens to the file after ten results: nothing more is said to be stored, and the
  /// command that is named goes on from all that was.
  /// @param first  What the command begins with.
  void expect_copy_after(const std::function<void()>& fault, const std::string& what,
                         const std::string& first = "") {
    StoreWriter& writer = serve(100);
    deliver(writer, 0, 10);
    (void)take_completions();
    fault();
    deliver(writer, 10, 20);
    deliver(writer, 20, 30);
    const std::vector<std::string> completions = take_completions();
    const std::string command = first + "mv --backup " + copy().string() + " " + file().string();
    ASSERT_THAT(completions, ElementsAre(AllOf(StartsWith("abandoned "), HasSubstr(what),
                                               HasSubstr("run `" + command + "`"))));
    end();
    ASSERT_EQ(std::system(command.c_str()), 0);
    EXPECT_EQ(num_readable(file()), 10u);
    Store store = Store::open(file());
    store.commit(deliveries_of(10, 30));
    EXPECT_EQ(results_in(store).size(), 30u);
    EXPECT_EQ(test::event_kinds_in(file()), "");
  }
};

// Whatever has the name is not touched until the operator moves it away.
TEST_F(StorePlace, AFileThatIsReplacedByAnotherCampaignIsCopied) {
  expect_copy_after([&] { replace_by_another(); }, "was replaced by another file");
  EXPECT_EQ(num_readable(backup()), 10u) << "the file under its other name";
  EXPECT_EQ(Store::open_read_only(file().string() + "~").num_runs(), 7u);
}

TEST_F(StorePlace, AFileWhoseLogIsRemovedIsCopied) {
  expect_copy_after([&] { std::filesystem::remove(detail::log_path(file())); },
                    "lost its write-ahead log");
}

// Nobody can tell what happened to it meanwhile.
TEST_F(StorePlace, AFileThatComesBackStaysAbandoned) {
  Store store = create(100);
  store.commit(deliveries_of(0, 10));
  std::filesystem::rename(file(), backup());
  const std::string error = test::store_error_of([&] { store.check_place(); });
  EXPECT_THAT(error, HasSubstr(copy().string()));
  std::filesystem::rename(backup(), file());
  EXPECT_THAT(test::store_error_of([&] { store.commit(deliveries_of(10, 20)); }),
              HasSubstr(copy().string()));
  EXPECT_TRUE(store.is_abandoned());
  EXPECT_EQ(num_readable(file()), 10u);
}

// No look before the commit can see it. The copy has the results of the commit, which nobody was
// told to be stored.
TEST_F(StorePlace, AResultIsNotNamedThatIsCommittedWhileTheFileIsRemoved) {
  StoreWriter& writer = serve(100);
  deliver(writer, 0, 10);
  (void)take_completions();
  {
    bool is_removed = false;
    const test::BeforeWrites removal([&] {
      if (!std::exchange(is_removed, true)) std::filesystem::remove(file());
    });
    deliver(writer, 10, 12);
  }
  EXPECT_THAT(take_completions(), ElementsAre(StartsWith("abandoned ")));
  EXPECT_EQ(num_readable(copy()), 12u);
}

// A log of another file beside the name would be applied to the copy.
TEST_F(StorePlace, TheLogOfWhatTookTheNameGoesFirst) {
  { (void)Store::create(backup(), campaign_of(7), ""); }
  test::run_and_kill([&] {
    auto* const killed = new Store(Store::open(backup()));  // Never closed.
    killed->commit(deliveries_of(5, 7));
  });
  expect_copy_after(
      [&] {
        for (const char* const ending : {"", "-wal", "-shm"}) {
          std::filesystem::rename(backup().string() + ending, file().string() + ending);
        }
      },
      "was replaced by another file", "rm " + file().string() + "-wal && ");
}

TEST_F(StorePlace, ACopyThatCannotBeWrittenIsTriedAgain) {
  const std::filesystem::path folder = directory() / "folder";
  std::filesystem::create_directory(folder);
  StoreWriter& writer = start();
  writer.open(id, Store::create(folder / "campaign.db", campaign_of(100), ""));
  deliver(writer, 0, 10);
  (void)take_completions();
  std::filesystem::remove_all(folder);
  deliver(writer, 10, 20);
  EXPECT_THAT(take_completions(),
              ElementsAre(AllOf(StartsWith("failed "), HasSubstr("a copy cannot be written"),
                                HasSubstr("do not stop this program"))));
  std::filesystem::create_directory(folder);
  writer.flush();
  EXPECT_THAT(take_completions(), ElementsAre(StartsWith("abandoned ")));
  ASSERT_THAT(copies_in(folder), SizeIs(1));
  EXPECT_EQ(num_readable(copies_in(folder).front()), 10u);
}

TEST_F(StorePlace, ACopyThatTheDiskDoesNotTakeLeavesTheLog) {
  Store store = create(2000);
  store.commit(deliveries_of(0, 1000));
  std::filesystem::rename(file(), backup());
  {
    const test::FileSizeLimit limit(150'000);  // More than a new campaign database needs.
    EXPECT_THAT(error_of_rest(store), HasSubstr("a copy cannot be written"));
    EXPECT_TRUE(detail::has_log(file()));
    EXPECT_FALSE(store.is_abandoned());
  }
  const std::string error = error_of_rest(store);
  EXPECT_THAT(error, HasSubstr(copy().string()));
  EXPECT_EQ(num_readable(copy()), 1000u);
}

TEST_F(StorePlace, AReaderDoesNotHoldUpTheCopy) {
  Store store = create(100);
  store.commit(deliveries_of(0, 10));
  const Store reader = Store::open_read_only(file());
  reader.read_one_state([&] {
    (void)reader.num_runs();
    store.commit(deliveries_of(10, 20));
    replace_by_another();
    EXPECT_NE(error_of_rest(store), "");
    EXPECT_EQ(num_readable(copy()), 20u);
  });
}

// Otherwise a restarted coordinator would begin anew, and the copy would be forgotten.
TEST_F(StorePlace, NoNewFileIsMadeBesideACopyOfTheOneThatIsGone) {
  {
    Store store = create(100);
    store.commit(deliveries_of(0, 10));
    std::filesystem::remove(file());
  }
  const std::string name = copy().filename().string();
  EXPECT_EQ(test::store_error_of([&] { (void)create(100); }),
            "campaign database = " + file().string() + " (is gone, but its copy " + name +
                " is there: give it the name, or move " + name + " away and begin anew)");
}

// What was cut off cannot be had back; nothing more is stored, or named as stored.
TEST_F(StorePlace, AFileThatIsTruncatedIsNamedAtOnceAndLeftAlone) {
  StoreWriter& writer = serve(100);
  deliver(writer, 0, 10);
  (void)take_completions();
  std::filesystem::resize_file(file(), 4096);
  writer.flush();
  EXPECT_THAT(take_completions(), ElementsAre(AllOf(StartsWith("abandoned "),
                                                    HasSubstr("was truncated or written over"))));
  std::filesystem::resize_file(file(), 1 << 20);  // The hole does not bring it back.
  deliver(writer, 10, 20);
  EXPECT_THAT(take_completions(), IsEmpty());
  std::filesystem::resize_file(file(), 4096);
  end();
  EXPECT_EQ(std::filesystem::file_size(file()), 4096U);
  EXPECT_THAT(copies_in(directory()), IsEmpty());
}

// The connection to the lost file must not touch the log of what has its name now.
TEST_F(StorePlace, ClosingALostFileLeavesTheFileInItsPlaceAsItIs) {
  {
    Store store = create(100);
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
  StoreWriter& writer = serve(100);
  deliver(writer, 0, 10);
  std::filesystem::create_hard_link(file(), directory() / "second.db");
  deliver(writer, 10, 20);
  EXPECT_THAT(take_completions(), Not(testing::Contains(HasSubstr("failed"))));
  EXPECT_NE(test::store_error_of([&] { Store::open(directory() / "second.db"); }), "");
}

TEST_F(StorePlace, KeepsASecondCoordinatorAwayThoughBothLockFilesWereRemoved) {
  Store first = create(100);
  first.commit(deliveries_of(0, 10));
  std::filesystem::remove(file().string() + ".lock");
  EXPECT_EQ(test::store_error_of([&] { Store::open(file()); }),
            message("another coordinator has it; a campaign has one coordinator at a time"));
  first.commit(deliveries_of(10, 20));
  EXPECT_EQ(num_readable(file()), 20u);
}

}  // namespace
}  // namespace proofmass::coordinator
