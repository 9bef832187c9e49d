// Campaigns that are not served for a while, or with fewer runs than before.

#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <string>

#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

namespace fs = std::filesystem;

class Unserved : public FaultTest {
 protected:
  /// Moves the campaign's file, with what belongs to it, to a directory or back.
  void move_file(const std::string& from, const std::string& to) const {
    fs::create_directories(path(to));
    for (const std::string suffix : {".db", ".db-wal", ".db-shm"}) {
      const fs::path file = path(from + "/null" + suffix);
      if (fs::exists(file)) fs::rename(file, path(to + "/null" + suffix));
    }
  }
};

// The file cannot be opened when a coordinator starts: what workers have computed of the campaign
// stays with them, and in their spools, until it is served again.
TEST_F(Unserved, CampaignLeavesItsResultsWithTheWorkers) {
  write_null_campaign(2000);
  Process first = coordinator("first", {"null.toml"});
  Process worker = null_worker("worker", {"--spool", "spool"});
  wait_for_done("null", 200);
  first.signal(SIGKILL);
  (void)first.wait();
  move_file("served", "away");

  Process second = coordinator("second", {});
  wait_for_log("worker", "results_set_aside");
  second.signal(SIGTERM);
  EXPECT_EQ(second.wait(), 0) << errors_of("second");
  EXPECT_EQ(worker.wait(), 0) << errors_of("worker");
  EXPECT_EQ(num_log_lines("worker", "results_forgotten"), 0U) << errors_of("worker");
  EXPECT_TRUE(fs::exists(path("spool"))) << errors_of("worker");

  move_file("away", "served");
  Process third = coordinator("third", {"null.toml", "--exit-when-done"});
  Process successor = null_worker("successor", {"--spool", "spool"});
  EXPECT_EQ(third.wait(), 0) << errors_of("third");
  EXPECT_EQ(successor.wait(), 0) << errors_of("successor");
  EXPECT_EQ(num_log_lines("successor", "spool_read results="), 1U) << errors_of("successor");
  EXPECT_FALSE(fs::exists(path("spool")));
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

// A backup from before an extension is put in the place of the file. Workers hold results of runs
// that the campaign does not have any more, until it is extended again.
TEST_F(Unserved, ExtensionLeavesItsResultsWithTheWorkers) {
  write_null_campaign(200);
  {
    Process coordinator = this->coordinator("first", {"null.toml", "--exit-when-done"});
    const Process worker = null_worker("first-worker", {"--run-time", "0"});
    EXPECT_EQ(coordinator.wait(), 0) << errors_of("first");
  }
  fs::copy_file(file_of("null"), path("backup.db"));
  Process second = coordinator("second", {});
  wait_for_log("second", "coordinator_started");
  Process worker = null_worker("worker", {"--spool", "spool"});
  extend_null_campaign(2000);
  wait_for_done("null", 400);
  second.signal(SIGKILL);
  (void)second.wait();
  move_file("served", "away");
  fs::rename(path("backup.db"), file_of("null"));

  Process third = coordinator("third", {});
  wait_for_log("worker", "results_set_aside");
  EXPECT_EQ(num_log_lines("worker", "results_forgotten"), 0U) << errors_of("worker");
  extend_null_campaign(2000);
  end_when_done(third, "third", 1);
  EXPECT_EQ(worker.wait(), 0) << errors_of("worker");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

}  // namespace
}  // namespace proofmass::test
