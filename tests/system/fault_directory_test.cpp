// A coordinator and the files of its directory, with real processes: files that cannot be opened
// when it starts, and files with which nothing remains to be done.

#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/mount.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>

#include "coordinator/store/store.hpp"
#include "tests/skip_for_want.hpp"
#include "tests/system/fault_fixture.hpp"
#include "tests/system/network_namespace.hpp"

namespace proofmass::test {
namespace {

namespace fs = std::filesystem;

void execute(const fs::path& database, const std::string& sql) {
  sqlite3* connection = nullptr;
  ASSERT_EQ(sqlite3_open(database.c_str(), &connection), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(connection, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
      << sqlite3_errmsg(connection);
  sqlite3_close(connection);
}

class ServedDirectory : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    write_null_campaign(500);
  }

  /// Makes the file of `null` without a result.
  void make_open_file() const {
    Process coordinator = this->coordinator("maker", {"null.toml"});
    wait_for_log("maker", "coordinator_started");
    coordinator.signal(SIGTERM);
    EXPECT_EQ(coordinator.wait(), 0) << errors_of("maker");
  }
  /// Makes the file of `null` with all results.
  void make_finished_file() const {
    Process coordinator = this->coordinator("maker", {"null.toml", "--exit-when-done"});
    const Process worker = null_worker("maker-worker", {"--run-time", "0"});
    EXPECT_EQ(coordinator.wait(), 0) << errors_of("maker");
  }

  [[nodiscard]] nlohmann::json unserved() const {
    return nlohmann::json::parse(told({"status", "--json"})).at("unserved_files");
  }

  void expect_finished_here() const {
    wait_for_log("coordinator", "campaign_finished");
    EXPECT_EQ(digest("null"), undisturbed_digest("null"));
  }
};

TEST_F(ServedDirectory, HasAFileThatIsLockedForAMoment) {
  make_open_file();
  std::optional<coordinator::Store> holder = coordinator::Store::open(file_of("null"));
  const Process coordinator = this->coordinator("coordinator", {"--time-scale", "0.05"});
  wait_for_log("coordinator", "campaign_not_served");
  const Process worker = null_worker("worker", {"--run-time", "0"});
  ASSERT_EQ(unserved().size(), 1U);
  EXPECT_EQ(unserved()[0].at("file"), "null.db");
  EXPECT_TRUE(contains(unserved()[0].at("reason"), "null.db"));
  holder.reset();
  wait_for_log("coordinator", "campaign_file_served file=served/null.db");
  expect_finished_here();
  EXPECT_TRUE(unserved().empty());
  EXPECT_EQ(num_log_lines("coordinator", "campaign_not_served"), 1U);
}

TEST_F(ServedDirectory, GetsACopyBackForAFileThatIsDamaged) {
  make_open_file();
  fs::copy_file(file_of("null"), path("copy.db"));
  fs::resize_file(file_of("null"), 5000);
  const Process coordinator = this->coordinator("coordinator", {"--time-scale", "0.05"});
  wait_for_log("coordinator",
               "campaign_not_served reason=\"campaign database = served/null.db (is ");
  fs::rename(path("copy.db"), file_of("null"));
  const Process worker = null_worker("worker", {"--run-time", "0"});
  expect_finished_here();
}

// The end waits for what cannot be served yet.
TEST_F(ServedDirectory, IsNotDoneBeforeAllOfItIsServed) {
  make_open_file();
  std::optional<coordinator::Store> holder = coordinator::Store::open(file_of("null"));
  Process coordinator =
      this->coordinator("coordinator", {"--time-scale", "0.05", "--exit-when-done"});
  wait_for_log("coordinator", "campaign_not_served");
  const Process worker = null_worker("worker", {"--run-time", "0"});
  wait_for_log("coordinator", "worker_registered");
  EXPECT_FALSE(coordinator.has_ended());
  holder.reset();
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

// A session that is no number: reading who was registered throws.
TEST_F(ServedDirectory, HasAFileWithABadRow) {
  make_open_file();
  fs::copy_file(file_of("null"), file_of("bad"));
  execute(file_of("bad"),
          "UPDATE campaign SET name = 'bad', campaign_uid = campaign_uid + 1;"
          "INSERT INTO worker (session, worker, host) VALUES ('zzzzzzzzzzzzzzzz', 'w', 'h')");
  const Process coordinator = this->coordinator("coordinator", {});
  const Process worker = null_worker("worker", {"--run-time", "0"});
  expect_finished_here();
  ASSERT_EQ(unserved().size(), 1U);
  EXPECT_EQ(unserved()[0].at("file"), "bad.db");
}

/// The directory is a small file system of its own.
class SmallDirectory : public ServedDirectory {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    fs::create_directory(path("served"));
    if (!take_private_mounts() ||
        ::mount("tmpfs", path("served").c_str(), "tmpfs", 0, "size=700k") != 0) {
      skip_for_want("no permission to mount a file system");
    }
  }
  void TearDown() override { umount2(path("served").c_str(), MNT_DETACH); }

  void enlarge() const {
    ASSERT_EQ(::mount(nullptr, path("served").c_str(), nullptr, MS_REMOUNT, "size=16m"), 0);
  }
  /// Takes all space that is left.
  void fill() const {
    std::ofstream ballast(path("served/ballast"), std::ios::binary);
    while (ballast.put('x')) ballast.flush();
  }
};

TEST_F(SmallDirectory, IsFullWhenTheCoordinatorStarts) {
  write_null_campaign(500);
  make_open_file();
  fill();
  const Process coordinator = this->coordinator("coordinator", {"--time-scale", "0.05"});
  wait_for_log("coordinator", "campaign_not_served");
  EXPECT_EQ(unserved().size(), 1U);
  const Process worker = null_worker("worker", {"--run-time", "0"});
  fs::remove(path("served/ballast"));
  enlarge();
  expect_finished_here();
}

// Who starts it next must know that results may be missing.
TEST_F(SmallDirectory, IsFullWhenTheCoordinatorEnds) {
  Process coordinator =
      this->coordinator("coordinator", {"null.toml", "--time-scale", "0.1", "--drain-time", "1"});
  const Process worker = null_worker("worker");
  wait_for_log("coordinator", "storage_failed");
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 1) << errors_of("coordinator");
  EXPECT_EQ(num_log_lines("coordinator", "results_not_stored runs="), 1U)
      << errors_of("coordinator");
}

/// What a process has read and written until now, through files and pipes of any kind.
struct IoCounts {
  std::uint64_t num_bytes_read = 0;
  std::uint64_t num_bytes_written = 0;
};

IoCounts io_counts_of(const std::string& process) {
  IoCounts counts;
  std::ifstream io(process + "/io");
  std::string name;
  for (std::uint64_t value = 0; io >> name >> value;) {
    if (name == "rchar:") counts.num_bytes_read = value;
    if (name == "wchar:") counts.num_bytes_written = value;
  }
  return counts;
}

/// A directory of many campaigns that have finished.
class FinishedCampaigns : public ServedDirectory {
 protected:
  static constexpr int num_files = 300;

  void SetUp() override {
    FaultTest::SetUp();
    write_null_campaign(16);
    make_finished_file();
    fs::create_directory(path("many"));
    for (int i = 0; i < num_files; ++i) {
      const std::string name = std::string("c").append(std::to_string(i));
      const fs::path file = path("many") / (name + ".db");
      fs::copy_file(file_of("null"), file);
      execute(file, "UPDATE campaign SET name = '" + name +
                        "', campaign_uid = " + std::to_string(1000 + i));
    }
    served = "many";
  }

  [[nodiscard]] std::map<std::string, fs::file_time_type> times() const {
    std::map<std::string, fs::file_time_type> times;
    for (const auto& item : fs::directory_iterator(path("many"))) {
      if (item.path().extension() != ".db") continue;
      times[item.path().filename()] = fs::last_write_time(item.path());
    }
    return times;
  }
};

// Each of them was opened once: it was read, written to twice and kept open.
TEST_F(FinishedCampaigns, CostNothing) {
  const auto before = times();
  Process coordinator = this->coordinator("coordinator", {});
  wait_for_log("coordinator", "coordinator_started");
  const std::string process = "/proc/" + std::to_string(coordinator.id());
  const IoCounts io = io_counts_of(process);
  // Two looks at each, which take the header, the schema and the first rows: a dozen pages.
  EXPECT_LT(io.num_bytes_read, num_files * 32 * 4096U);
#ifndef __SANITIZE_THREAD__
  EXPECT_LT(io.num_bytes_written, 4096U);  // The log; ThreadSanitizer adds 512 KiB.
#endif
  const Process worker = null_worker("worker");
  wait_for_log("coordinator", "worker_registered");
  const nlohmann::json status = nlohmann::json::parse(told({"status", "--json"}));
  EXPECT_EQ(status.at("campaigns").size(), std::size_t{num_files});
  EXPECT_EQ(status.at("campaigns")[7].at("phase"), "finished");
  EXPECT_EQ(status.at("campaigns")[7].at("num_done"), 16);
  std::size_t num_open = 0;
  for (const auto& item : fs::directory_iterator(process + "/fd")) {
    std::error_code ignored;
    num_open += fs::read_symlink(item.path(), ignored).extension() == ".db" ? 1U : 0U;
  }
  EXPECT_EQ(num_open, 0U);
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(times(), before);
}

TEST_F(ServedDirectory, HasACampaignThatIsWholeWhenItFinishesAndGoesOn) {
  const Process coordinator = this->coordinator("coordinator", {"null.toml"});
  const Process worker = null_worker("worker", {"--run-time", "0"});
  const fs::path log = file_of("null").concat("-wal");
  const auto wait_for_rest = [&](std::size_t num_summaries) {
    wait_until("statistics", [&] {
      return num_log_lines("coordinator", "campaign_summarised") == num_summaries;
    });
    wait_until("empty log", [&] { return !fs::exists(log) || fs::file_size(log) == 0; });
  };
  wait_for_rest(1);
  EXPECT_EQ(status_of("null").at("phase"), "finished");
  // A copy of the file alone has all of it.
  fs::copy_file(file_of("null"), path("copy.db"));
  EXPECT_EQ(num_stored(path("copy.db")), 500U);
  extend_null_campaign(700);
  wait_for_rest(2);
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

// What was acknowledged is not lost because nothing remains to be done.
TEST_F(ServedDirectory, HasACopyOfTheFileOfAFinishedCampaignThatIsRemoved) {
  const Process coordinator =
      this->coordinator("coordinator", {"null.toml", "--time-scale", "0.05"});
  const Process worker = null_worker("worker", {"--run-time", "0"});
  wait_for_log("coordinator", "campaign_summarised");
  fs::remove(file_of("null"));
  wait_for_log("coordinator", "storage_failed reason=");
  fs::path copy;
  for (const auto& item : fs::directory_iterator(path("served"))) {
    if (contains(item.path().filename().string(), "null.recovered-")) copy = item.path();
  }
  ASSERT_FALSE(copy.empty());
  fs::rename(copy, file_of("null"));
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

}  // namespace
}  // namespace proofmass::test
