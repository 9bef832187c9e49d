// A writer whose disk does not take what it is given.

#include <gmock/gmock.h>
#include <sched.h>
#include <sys/mount.h>

#include <numeric>

#include "coordinator/store/detail/database.hpp"
#include "tests/coordinator/store/writer_fixture.hpp"
#include "tests/skip_for_want.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using test::campaign_of;
using test::committed;
using test::delivery_of;
using test::FileSizeLimit;
using test::patient_config;
using test::results_in;
using test::wrong_delivery_of;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class StoreWriterDisk : public test::WriterTest {
 protected:
  /// `failed campaign database = <file()> (<reason>)`
  [[nodiscard]] std::string failed(const std::string& reason) const {
    return "failed campaign database = " + file().string() + " (" + reason + ")";
  }
  const std::string io_error = "disk I/O error; what was committed before is safe";
};

constexpr rlim_t small_size = 150'000;  // More than a new campaign database needs.

TEST_F(StoreWriterDisk, KeepsEverythingThroughAFailureAndReportsItOnce) {
  StoreWriter& writer = start();
  writer.open(id, create(5000));
  {
    const FileSizeLimit limit(small_size);
    for (std::uint64_t run = 0; run < 2000; ++run) writer.deliver(id, delivery_of(run));
    writer.compare(id, wrong_delivery_of(1999));
    writer.flush();
    EXPECT_THAT(take_completions(), ElementsAre(failed(io_error)));
    writer.deliver(id, delivery_of(2000));
    writer.flush();
    EXPECT_THAT(take_completions(), IsEmpty());
    EXPECT_THAT(Store::open_read_only(file()).finished_runs(), IsEmpty());
  }
  writer.flush();
  std::vector<std::uint64_t> runs(2000);
  std::iota(runs.begin(), runs.end(), 0);
  EXPECT_THAT(take_completions(), ElementsAre(committed(runs), "compared 1999 different",
                                              "recovered", "committed 2000"));
}

TEST_F(StoreWriterDisk, TriesAgainByItself) {
  WriterConfig config = patient_config();
  config.commit_runs_max = 2000;
  config.retry_after = std::chrono::milliseconds(1);
  StoreWriter& writer = start(config);
  writer.open(id, create(5000));
  {
    const FileSizeLimit limit(small_size);
    for (std::uint64_t run = 0; run < 2000; ++run) writer.deliver(id, delivery_of(run));
    wait_for(failed(io_error));
  }
  wait_for("recovered");
  EXPECT_EQ(results_in(Store::open_read_only(file())).size(), 2000u);
}

TEST_F(StoreWriterDisk, DropsRecordsThatNobodyWaitsForBeyondALimit) {
  WriterConfig config = patient_config();
  config.num_records_max = 3;
  StoreWriter& writer = start(config);
  writer.open(id, create(5000));
  {
    const FileSizeLimit limit(small_size);
    for (std::uint64_t run = 0; run < 2000; ++run) writer.deliver(id, delivery_of(run));
    writer.flush();
    for (const std::string kind : {"a", "b", "c", "d", "e"}) {
      writer.record_event(id, {.kind = kind, .text = ""});
    }
    writer.flush();
  }
  writer.flush();
  EXPECT_THAT(take_completions(), Contains("recovered"));
  EXPECT_EQ(text("SELECT group_concat(kind || text) FROM event"),
            "a,b,c,records_droppedlosses_and_events=2 (the disk did not take them for too long)");
}

TEST_F(StoreWriterDisk, ReportsWhatNoDiskIsToBlameFor) {
  StoreWriter& writer = start();
  writer.open(id, create(5));
  writer.deliver(id, delivery_of(5));
  writer.flush();
  EXPECT_THAT(take_completions(),
              ElementsAre("failed run_result.run_index = 5 (must be below num_runs = 5)"));
}

TEST_F(StoreWriterDisk, ServesOtherFilesWhileOneFails) {
  constexpr wire::CampaignId other{2};
  StoreWriter& writer = start();
  writer.open(id, create(5));
  writer.open(other, Store::create(directory() / "other.db", campaign_of(100), ""));
  writer.deliver(id, delivery_of(5));
  writer.deliver(other, delivery_of(5));
  writer.flush();
  EXPECT_THAT(take_completions(), Contains("committed 5"));
  EXPECT_THAT(Store::open_read_only(file()).finished_runs(), IsEmpty());
}

TEST_F(StoreWriterDisk, GivesBackAFileThatCannotBeWritten) {
  StoreWriter& writer = start();
  writer.open(id, create(5000));
  const FileSizeLimit limit(small_size);
  for (std::uint64_t run = 0; run < 2000; ++run) writer.deliver(id, delivery_of(run));
  const Store store = writer.close(id);
  EXPECT_THAT(store.finished_runs(), IsEmpty());
  EXPECT_THAT(take_completions(), ElementsAre(failed(io_error)));
}

TEST_F(StoreWriterDisk, EndsWithoutWaitingForIt) {
  StoreWriter& writer = start();
  writer.open(id, create(5000));
  {
    const FileSizeLimit limit(small_size);
    for (std::uint64_t run = 0; run < 2000; ++run) writer.deliver(id, delivery_of(run));
    end();
  }
  EXPECT_THAT(Store::open(file()).finished_runs(), IsEmpty());
}

/// A file system of one megabyte that only this process sees.
class SmallFileSystem {
 public:
  explicit SmallFileSystem(std::filesystem::path path) : path_(std::move(path)) {
    std::filesystem::create_directory(path_);
    is_mounted_ = ::unshare(CLONE_NEWNS) == 0 &&
                  ::mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
                  ::mount("tmpfs", path_.c_str(), "tmpfs", 0, "size=1m") == 0;
  }
  ~SmallFileSystem() {
    if (is_mounted_) ::umount2(path_.c_str(), MNT_DETACH);
  }
  SmallFileSystem(const SmallFileSystem&) = delete;
  SmallFileSystem& operator=(const SmallFileSystem&) = delete;

  [[nodiscard]] bool is_mounted() const { return is_mounted_; }

 private:
  std::filesystem::path path_;
  bool is_mounted_ = false;
};

TEST_F(StoreWriterDisk, GoesOnWhenSpaceIsFreedOnAFullOne) {
  const std::filesystem::path mount = directory() / "small";
  const SmallFileSystem small(mount);
  if (!small.is_mounted()) return test::skip_for_want("no permission to mount a file system");
  StoreWriter& writer = start();
  writer.open(id, Store::create(mount / "campaign.db", campaign_of(5000), ""));
  std::ofstream ballast(mount / "ballast");
  ballast << std::string(700'000, 'x') << std::flush;
  for (std::uint64_t run = 0; run < 1000; ++run) writer.deliver(id, delivery_of(run));
  writer.flush();
  EXPECT_THAT(take_completions(),
              ElementsAre("failed campaign database = " + (mount / "campaign.db").string() +
                          " (the disk is full; what was committed before is safe, free space and "
                          "try again)"));
  ballast.close();
  std::filesystem::remove(mount / "ballast");
  writer.flush();
  EXPECT_THAT(take_completions(), Contains("recovered"));
  end();
  EXPECT_EQ(results_in(Store::open(mount / "campaign.db")).size(), 1000u);
}

}  // namespace
}  // namespace proofmass::coordinator
