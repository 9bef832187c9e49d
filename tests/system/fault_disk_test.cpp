// Campaigns on disks that are full, read-only or of another machine. It takes root: without it the
// tests are skipped, but fail in CI.

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "tests/skip_for_want.hpp"
#include "tests/system/fault_fixture.hpp"
#include "tests/system/network_namespace.hpp"

namespace proofmass::test {
namespace {

namespace fs = std::filesystem;

/// The directory `served` is a small file system of its own.
class FaultyDisk : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    fs::create_directory(path("served"));
    if (!take_private_mounts() || mount("tmpfs", "tmpfs", 0, "size=700k") != 0) {
      skip_for_want("no permission to mount a file system");
    }
  }
  void TearDown() override { umount2(path("served").c_str(), MNT_DETACH); }

  [[nodiscard]] int mount(const char* source, const char* kind, unsigned long flags,
                          const char* options) const {
    return ::mount(source, path("served").c_str(), kind, flags, options);
  }
  void enlarge() const { ASSERT_EQ(mount(nullptr, nullptr, MS_REMOUNT, "size=16m"), 0); }
};

// Workers keep what cannot be stored until it can.
TEST_F(FaultyDisk, IsFullForAWhile) {
  Process coordinator =
      this->coordinator("coordinator", {"null.toml", "--exit-when-done", "--time-scale", "0.1"});
  Process one = null_worker("one");
  Process two = null_worker("two");
  wait_for_log("coordinator", "storage_failed");
  const std::size_t num_before = num_done("null");
  EXPECT_GT(num_before, 0U);
  EXPECT_LT(num_before, num_null_runs);
  EXPECT_NE(status_of("null").at("storage_failure"), nullptr);
  Process submit = start_behind({}, "submit", "proofmass",
                                {"submit", "null.toml", "--connect", clients_endpoint});
  EXPECT_EQ(submit.wait(), 1);
  EXPECT_TRUE(contains(errors_of("submit"), "(the disk is full; ")) << errors_of("submit");
  enlarge();
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(one.wait(), 0) << errors_of("one");
  EXPECT_EQ(two.wait(), 0) << errors_of("two");
  EXPECT_EQ(num_log_lines("coordinator", "storage_recovered"), 1U);
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

// Results that were never acknowledged are still with their workers. Whether there is room for the
// row that says that another coordinator began is chance; without, it ends and says why.
TEST_F(FaultyDisk, IsFullWhenTheCoordinatorIsKilledAndStartedAgain) {
  const Process one = null_worker("one");
  const Process two = null_worker("two");
  {
    Process killed = coordinator("killed", {"null.toml"});
    wait_for_log("killed", "storage_failed");
    killed.signal(SIGKILL);
    EXPECT_EQ(killed.wait(), -SIGKILL);
  }
  const Arguments options{"--exit-when-done", "--time-scale", "0.1"};
  Process coordinator = this->coordinator("coordinator", options);
  wait_for_log("coordinator", "(the disk is full; ");
  enlarge();
  int exit_code = coordinator.wait();
  if (exit_code == 1) exit_code = this->coordinator("again", options).wait();
  EXPECT_EQ(exit_code, 0) << errors_of("coordinator") << errors_of("again");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

TEST_F(FaultyDisk, HasNoRoomForACampaign) {
  std::ofstream(path("served/ballast")) << std::string(650'000, 'x');
  const Process coordinator = this->coordinator("coordinator", {});
  wait_for_log("coordinator", "coordinator_started");
  Process submit = start_behind({}, "submit", "proofmass",
                                {"submit", "null.toml", "--connect", clients_endpoint});
  EXPECT_EQ(submit.wait(), 1);
  EXPECT_EQ(errors_of("submit"),
            "proofmass: error: campaign database = null.db.unfinished (the disk is full; what was "
            "committed before is safe, free space and try again)\n");
  EXPECT_FALSE(fs::exists(file_of("null")));
  fs::remove(path("served/ballast"));
  enlarge();
  (void)told({"submit", "null.toml"});
  const Process worker = null_worker("worker");
  wait_for_log("coordinator", "campaign_finished");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

TEST_F(FaultyDisk, IsReadOnly) {
  ASSERT_EQ(mount(nullptr, nullptr, MS_REMOUNT | MS_RDONLY, nullptr), 0);
  Process coordinator = this->coordinator("coordinator", {"null.toml"});
  EXPECT_EQ(coordinator.wait(), 1);
  EXPECT_EQ(
      errors_of("coordinator"),
      "proofmass-coordinator: error: lock = served/coordinator.lock (Read-only file system)\n");
}

TEST_F(FaultyDisk, IsFullWhenTheCoordinatorStarts) {
  write_null_campaign(500);
  {
    Process maker = coordinator("maker", {"null.toml"});
    wait_for_log("maker", "coordinator_started");
    maker.signal(SIGTERM);
    EXPECT_EQ(maker.wait(), 0) << errors_of("maker");
  }
  {
    std::ofstream ballast(path("served/ballast"), std::ios::binary);
    while (ballast.put('x')) ballast.flush();
  }
  const Process coordinator = this->coordinator("coordinator", {"--time-scale", "0.05"});
  wait_for_log("coordinator", "campaign_not_served");
  EXPECT_TRUE(contains(told({"status"}), "not served, tried again: "));
  const Process worker = null_worker("worker", {"--run-time", "0"});
  fs::remove(path("served/ballast"));
  enlarge();
  wait_for_log("coordinator", "campaign_finished");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

// Who starts it next must know that results may be missing.
TEST_F(FaultyDisk, IsFullWhenTheCoordinatorEnds) {
  Process coordinator =
      this->coordinator("coordinator", {"null.toml", "--time-scale", "0.1", "--drain-time", "1"});
  const Process worker = null_worker("worker");
  wait_for_log("coordinator", "storage_failed");
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 1) << errors_of("coordinator");
  EXPECT_EQ(num_log_lines("coordinator", "results_not_stored runs="), 1U)
      << errors_of("coordinator");
}

/// `served` is a directory of another machine, as far as the kernel knows.
class NetworkFileSystem : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    write_null_campaign(64);
    if (!fs::exists("/dev/fuse") || !take_private_mounts()) {
      skip_for_want("no file systems in user space, or no permission to mount one");
      return;
    }
    fs::create_directory(path(served));
    fs::create_directory(path("remote"));
    // Both ends of what would be a connection.
    const std::string script =
        "mkfifo there back; /usr/lib/openssh/sftp-server < there > back & "
        "sshfs -f -o passive :remote served > there < back";
    sshfs_.emplace(directory / "", "sshfs", "/bin/bash", Arguments{"-c", script});
    wait_until("mount", [&] { return device_of(served) != device_of("remote"); });
  }
  void TearDown() override { umount2(path(served).c_str(), MNT_DETACH); }

 private:
  [[nodiscard]] dev_t device_of(const std::string& name) const {
    struct stat status {};
    EXPECT_EQ(stat(path(name).c_str(), &status), 0);
    return status.st_dev;
  }

  std::optional<Process> sshfs_;
};

TEST_F(NetworkFileSystem, HasCampaignsForReadersOnly) {
  const std::string before = undisturbed_digest("null");
  const std::string refusal =
      "(is on the network file system fuse.sshfs, where a campaign database may "
      "be damaged; use a local disk)\n";
  Process made = start_behind({}, "made", "proofmass", {"run", "null.toml", "--db", "served/a.db"});
  EXPECT_EQ(made.wait(), 1);
  EXPECT_TRUE(errors_of("made").ends_with(refusal)) << errors_of("made");
  EXPECT_TRUE(fs::is_empty(path(served)));

  fs::copy_file(path("undisturbed/null.db"), file_of("null"));
  write_null_campaign(128);
  Process extended =
      start_behind({}, "extended", "proofmass", {"run", "null.toml", "--db", "served/null.db"});
  EXPECT_EQ(extended.wait(), 1);
  EXPECT_TRUE(errors_of("extended").ends_with(refusal)) << errors_of("extended");
  EXPECT_EQ(digest("null"), before);
}

}  // namespace
}  // namespace proofmass::test
