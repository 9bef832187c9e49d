// `proofmass run` whose disk is full or fails.

#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/mount.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "tests/skip_for_want.hpp"
#include "tests/system/fault_fixture.hpp"
#include "tests/system/network_namespace.hpp"

namespace proofmass::test {
namespace {

namespace fs = std::filesystem;

using RunFault = CampaignProcess;

/// Changes a file as anybody with SQL can.
void change_database(const fs::path& file, const char* sql) {
  sqlite3* connection = nullptr;
  EXPECT_EQ(sqlite3_open(file.c_str(), &connection), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(connection, sql, nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(connection);
}

/// What faulty_calls.cpp maps: which calls fail, with what, from which on, to which; then counts.
using FaultyOrders = std::array<std::uint32_t, 13>;

FaultyOrders orders_in(const fs::path& file) {
  FaultyOrders orders{};
  std::ifstream(file, std::ios::binary).read(reinterpret_cast<char*>(orders.data()), sizeof orders);
  return orders;
}

// Exit code 0 says that the file is whole, and then everybody can read it.
TEST_F(RunFault, OfADiskThatFailsAtTheEndIsToldOrHarmless) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "ThreadSanitizer does not work behind a library that is preloaded";
#endif
  const fs::path disk = path("disk"), file = disk / "synced.db", orders_file = path("orders");
  fs::create_directory(disk);
  constexpr std::uint32_t syncs = 1U << 2;
  // Starts the last of the runs with every sync from the n-th on failing.
  const auto run_with = [&](std::uint32_t first) {
    fs::copy_file(path("first.db"), file, fs::copy_options::overwrite_existing);
    for (const char* const ending : {"-wal", "-shm", "-journal"}) {
      fs::remove(file.string() + ending);
    }
    const FaultyOrders orders{syncs, EIO, first, 0xffffffff};
    std::ofstream(orders_file, std::ios::binary)
        .write(reinterpret_cast<const char*>(orders.data()), sizeof orders);
    return std::make_unique<Process>(
        directory / "", "synced", "/usr/bin/env",
        Arguments{"LD_PRELOAD=" + programs + "/../tests/proofmass_faulty_calls.so",
                  "PROOFMASS_FAULTY_DIRECTORY=" + disk.string(),
                  "PROOFMASS_FAULTY_ORDERS=" + orders_file.string(), programs + "/proofmass", "run",
                  "short.toml", "--db", file.string(), "--runs", "16", "--workers", "1"});
  };
  ASSERT_EQ(start("first", {"--workers", "1", "--runs", "16"}).wait(), 0);
  change_database(path("first.db"), "DELETE FROM summary");  // So that there is something to write.
  ASSERT_EQ(run_with(0xffffffff)->wait(), 0) << errors_of("synced");
  const std::uint32_t num_syncs = orders_in(orders_file).at(4);
  ASSERT_GE(num_syncs, 4U);
  for (std::uint32_t first = 1; first <= num_syncs; ++first) {
    const int exit_code = run_with(first)->wait();
    EXPECT_TRUE(exit_code == 0 ||
                contains(errors_of("synced"), "proofmass: error: campaign database"))
        << first << ": " << exit_code << errors_of("synced");
    if (exit_code != 0) continue;
    Process report(directory / "", "report", programs + "/proofmass", {"report", file.string()});
    EXPECT_EQ(report.wait(), 0) << first << ": " << errors_of("report");
  }
}

/// The database is on a small file system of its own, on which something else takes what is left.
class RunOnAFullDisk : public CampaignProcess {
 protected:
  void SetUp() override {
    CampaignProcess::SetUp();
    fs::create_directory(path("disk"));
    if (!take_private_mounts() ||
        mount("tmpfs", path("disk").c_str(), "tmpfs", 0, "size=2m") != 0) {
      skip_for_want("no permission to mount a file system");
    }
  }
  void TearDown() override { umount2(path("disk").c_str(), MNT_DETACH); }

  [[nodiscard]] Process start_on_disk(const std::string& name) const {
    return Process(directory / "", name, programs + "/proofmass",
                   {"run", "short.toml", "--db", "disk/" + name + ".db", "--workers", "1"});
  }
  /// Fills the disk while the campaign is computed and waits until the program tells of it.
  void fill_during(const std::string& name) const {
    wait_for_runs("disk/" + name, 16);
    std::ofstream ballast(path("disk/ballast"));
    while (ballast << std::string(4096, 'x') << std::flush) {
    }
    wait_until("note", [&] { return contains(errors_of(name), "tried again every 5 s\n"); });
    EXPECT_TRUE(contains(errors_of(name),
                         "error: campaign database = disk/" + name + ".db (the disk is full; "))
        << errors_of(name);
    wait_until("progress",
               [&] { return contains(errors_of(name), " %  nothing can be stored\n"); });
  }
  void free_disk() const { fs::remove(path("disk/ballast")); }
};

TEST_F(RunOnAFullDisk, TellsThatItWaitsAndThatItGoesOn) {
  Process run = start_on_disk("full");
  fill_during("full");
  free_disk();
  EXPECT_EQ(run.wait(), 0) << errors_of("full");
  EXPECT_TRUE(contains(errors_of("full"), "all results are stored again\n")) << errors_of("full");
  EXPECT_TRUE(stored_runs(path("disk/full.db")) == reference());
}

TEST_F(RunOnAFullDisk, TellsWhatIsStoredWhenItIsInterrupted) {
  Process run = start_on_disk("stopped");
  fill_during("stopped");
  run.signal(SIGINT);
  EXPECT_EQ(run.wait(), 130) << errors_of("stopped");
  const std::size_t num_left = num_stored(path("disk/stopped.db"));
  EXPECT_TRUE(contains(errors_of("stopped"), "interrupted; " + std::to_string(num_left) +
                                                 " of 320 runs are in disk/stopped.db"))
      << errors_of("stopped");
  EXPECT_GE(num_left, 16U);
  EXPECT_LT(num_left, num_runs);
  free_disk();
  EXPECT_EQ(start_on_disk("stopped").wait(), 0) << errors_of("stopped");
  EXPECT_TRUE(stored_runs(path("disk/stopped.db")) == reference());
}

}  // namespace
}  // namespace proofmass::test
