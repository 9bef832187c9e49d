// `proofmass run` whose disk is full.

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
