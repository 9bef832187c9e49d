// Campaign databases that somebody else uses or has spoilt.

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>
#include <string>

#include "coordinator/store/store.hpp"
#include "tests/skip_for_want.hpp"
#include "tests/system/fault_fixture.hpp"
#include "tests/system/network_namespace.hpp"

namespace proofmass::test {
namespace {

namespace fs = std::filesystem;

class CampaignFiles : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    write_null_campaign(1000);
  }

  /// Finishes the campaign and ends.
  void serve_undisturbed() const {
    Process coordinator = this->coordinator("first", {"null.toml", "--exit-when-done"});
    const Process worker = null_worker("worker", {"--run-time", "0"});
    EXPECT_EQ(coordinator.wait(), 0) << errors_of("first");
  }

  /// What a coordinator on another directory says, which has nothing to serve there.
  [[nodiscard]] std::string log_of_another(const std::string& name) const {
    const Process coordinator =
        start_behind({}, name, "proofmass-coordinator",
                     {"--directory", name, "--bind", "ipc://" + path("other").string()});
    wait_for_log(name, "coordinator_started");
    EXPECT_TRUE(contains(errors_of(name), "campaigns=0")) << errors_of(name);
    return errors_of(name);
  }

  /// Copies the campaign's file and writes over part of it.
  void damage_copy(const std::string& name, std::streamoff at, const std::string& bytes) const {
    fs::copy_file(file_of("null"), file_of(name));
    std::fstream(file_of(name), std::ios::in | std::ios::out | std::ios::binary).seekp(at) << bytes;
  }
  void cut_copy(const std::string& name, std::uintmax_t size) const {
    fs::copy_file(file_of("null"), file_of(name));
    fs::resize_file(file_of(name), size);
  }
};

TEST_F(CampaignFiles, HaveOneWriterByWhateverName) {
  const Process coordinator = this->coordinator("coordinator", {"null.toml"});
  const Process worker = null_worker("worker");
  wait_for_done("null", 1);
  const std::string held_by =
      "served/null.db.lock (held by process " + std::to_string(coordinator.id()) + " on ";

  Process run(directory / "", "run", programs + "/proofmass",
              {"run", "null.toml", "--db", "served/null.db"});
  EXPECT_EQ(run.wait(), 1);
  EXPECT_TRUE(contains(errors_of("run"), held_by)) << errors_of("run");

  fs::create_directory(path("second"));
  fs::create_symlink(file_of("null"), path("second/null.db"));
  EXPECT_TRUE(contains(log_of_another("second"), held_by));
  fs::create_directory(path("third"));
  fs::create_hard_link(file_of("null"), path("third/null.db"));
  EXPECT_TRUE(contains(log_of_another("third"),
                       "third/null.db (has 2 names (hard links), must have one; make copies"));

  wait_for_log("coordinator", "campaign_finished");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

TEST_F(CampaignFiles, ThatCannotBeServedAreNamedAndLeftAlone) {
  serve_undisturbed();
  const std::string digest_before = digest("null");
  const std::map<std::string, std::string> reasons{
      {"newer", "is newer than this program: its user_version is 99, the newest known one "},
      {"foreign", "is not a Proofmass campaign: its application_id is 0, not "},
      {"damaged", "is damaged: "},
      {"torn", "is damaged: "},
      {"short", "is damaged: "},
      {"empty", "is not a Proofmass campaign: its application_id is 0, not "},
      {"text", "is not an SQLite database"}};
  damage_copy("newer", 60, {'\0', '\0', '\0', 99});  // Bytes of a database's header, [SQLite].
  damage_copy("foreign", 68, {'\0', '\0', '\0', 0});
  damage_copy("damaged", 65536, std::string(65536, 'x'));
  cut_copy("torn", fs::file_size(file_of("null")) - 5000);
  cut_copy("short", 1000);
  std::ofstream(file_of("empty"));
  std::ofstream(file_of("text")) << "Notes.\n";
  std::map<std::string, std::string> bytes;
  for (const auto& [name, reason] : reasons) bytes[name] = read_file(file_of(name));

  const Process coordinator = this->coordinator("second", {});
  wait_for_log("second", "coordinator_started");
  for (const auto& [name, reason] : reasons) {
    EXPECT_EQ(num_log_lines("second", "campaign_not_served reason=\"campaign database = served/" +
                                          name + ".db (" + reason),
              1U)
        << name << "\n"
        << errors_of("second");
    EXPECT_EQ(read_file(file_of(name)), bytes.at(name)) << name;
  }
  EXPECT_EQ(status_of("null").at("phase"), "finished");
  EXPECT_EQ(digest("null"), digest_before);
}

// The file that is damaged is the one that is asked for: nothing takes its place.
TEST_F(CampaignFiles, ThatAreDamagedAreNotReplaced) {
  serve_undisturbed();
  fs::resize_file(file_of("null"), 5000);
  Process coordinator = this->coordinator("second", {"null.toml"});
  EXPECT_EQ(coordinator.wait(), 1);
  EXPECT_TRUE(
      contains(errors_of("second"),
               "proofmass-coordinator: error: campaign database = served/null.db (is damaged: "))
      << errors_of("second");
  EXPECT_EQ(fs::file_size(file_of("null")), 5000U);
}

/// The database of a live coordinator is taken from under it, by hand or by a restoring program.
class CampaignFileThatLosesItsName : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    write_null_campaign(2000);
  }

  /// The workers wait with what they hold until the coordinator goes on from the copy, with the
  /// command that the status names. The campaign ends as if nothing had happened: the same digest,
  /// one row a run.
  void expect_that_status_tells_how_to_go_on(Process& coordinator) const {
    std::smatch found;
    wait_until("a copy", [&] {
      const nlohmann::json failure = status_of("null")["storage_failure"];
      const std::string text = failure.is_string() ? failure.get<std::string>() : "";
      return std::regex_search(text, std::regex("`mv --backup \\S+ \\S+`"));
    });
    const std::string log = errors_of("coordinator");
    ASSERT_TRUE(std::regex_search(log, found, std::regex("`(mv --backup [^`]+)`")));
    coordinator.signal(SIGHUP);  // The workers stay.
    EXPECT_EQ(coordinator.wait(), 1) << errors_of("coordinator");
    ASSERT_EQ(std::system(found[1].str().c_str()), 0);
    Process next = this->coordinator("next", {"null.toml", "--exit-when-done"});
    EXPECT_EQ(next.wait(), 0) << errors_of("next");
    EXPECT_EQ(num_done("null"), num_null_runs);
    EXPECT_EQ(stored_text(file_of("null"), "SELECT count(*) FROM delivery"),
              std::to_string(num_null_runs));
    EXPECT_EQ(digest("null"), undisturbed_digest("null"));
    proofmass::coordinator::Store::open_read_only(file_of("null")).check_integrity();
  }
};

TEST_F(CampaignFileThatLosesItsName, ByBeingRemovedIsGoneOnWithFromItsCopy) {
  Process coordinator = this->coordinator("coordinator", {"null.toml"});
  const Process one = null_worker("one"), other = null_worker("other");
  wait_for_done("null", 200);
  fs::remove(file_of("null"));
  expect_that_status_tells_how_to_go_on(coordinator);
}

TEST_F(CampaignFileThatLosesItsName, ToAnOlderCopyIsGoneOnWithFromItsCopy) {
  Process coordinator = this->coordinator("coordinator", {"null.toml"});
  const Process one = null_worker("one"), other = null_worker("other");
  wait_for_done("null", 200);
  Process backup(directory / "", "backup", programs + "/proofmass",
                 {"backup", file_of("null").string(), path("backup.db").string()});
  ASSERT_EQ(backup.wait(), 0) << errors_of("backup");
  wait_for_done("null", 400);
  fs::rename(path("backup.db"), file_of("null"));
  expect_that_status_tells_how_to_go_on(coordinator);
}

// A copy of the file alone has every run, or is refused as it lacks its log.
TEST_F(CampaignFileThatLosesItsName, IsNoneThatIsCopiedAloneFromALiveCoordinator) {
  const Process coordinator = this->coordinator("coordinator", {"null.toml"});
  const Process worker = null_worker("worker", {"--run-time", "0"});
  wait_for_log("coordinator", "campaign_summarised");
  fs::copy_file(file_of("null"), path("alone.db"));
  Process report(directory / "", "report", programs + "/proofmass", {"report", "alone.db"});
  if (report.wait() == 0) {
    EXPECT_TRUE(contains(read_file(path("report.out")), "2000 finished of 2000"))
        << read_file(path("report.out"));
  } else {
    EXPECT_TRUE(contains(errors_of("report"), "alone.db (lacks its log alone.db-wal"))
        << errors_of("report");
  }
}

// What it held is lost; whoever looks after the coordinator learns it at once, not at the end.
TEST_F(CampaignFileThatLosesItsName, ByBeingTruncatedIsAFailureAtOnce) {
  const Process coordinator = this->coordinator("coordinator", {"null.toml"});
  const Process worker = null_worker("worker", {"--run-time", "0.05"});
  wait_for_done("null", 100);
  fs::resize_file(file_of("null"), 0);
  const std::string reason = "was truncated or written over while it was served";
  wait_for_log("coordinator", reason);
  EXPECT_TRUE(contains(status_of("null")["storage_failure"], reason));
  EXPECT_LT(status_of("null")["num_done"], 2000);
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
