// Campaigns on disks that are full or read-only. It takes root: without it the tests are skipped,
// but fail in CI.

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>

#include <filesystem>
#include <fstream>
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

}  // namespace
}  // namespace proofmass::test
