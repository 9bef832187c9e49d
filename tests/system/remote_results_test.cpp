// Results of a campaign by way of its coordinator, with real processes: what a client gets is what
// the same command gets from the file.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <regex>
#include <string>

#include "tests/system/campaign_process.hpp"

namespace proofmass::test {
namespace {

/// A coordinator that serves the finished campaign hardy2013, and its clients.
class RemoteResults : public CampaignProcess {
 protected:
  void SetUp() override {
    CampaignProcess::SetUp();
    write_small_campaign();
    coordinator_.reset(new Process(start_coordinator({"small.toml"})));
    worker_ = std::make_unique<Process>(directory / "", "worker", programs + "/proofmass-worker",
                                        Arguments{"--connect", endpoint(), "--threads", "1"});
    wait_until("the end of the campaign",
               [&] { return contains(errors_of("coordinator"), "campaign_summarised"); });
  }

  void write_small_campaign() const {
    const std::regex runs("\nruns = [0-9]+");
    std::ofstream(path("small.toml"))
        << std::regex_replace(read_file(path("short.toml")), runs, "\nruns = 64");
  }

  [[nodiscard]] std::string endpoint() const { return "ipc://" + path("socket").string(); }

  [[nodiscard]] Process start_coordinator(const Arguments& further) const {
    Arguments arguments{"--directory", "served", "--bind", endpoint()};
    arguments.insert(arguments.end(), further.begin(), further.end());
    return Process(directory / "", "coordinator", programs + "/proofmass-coordinator", arguments);
  }

  /// How a command ended; output and errors are in NAME.out and NAME.err.
  int command(const std::string& name, const Arguments& arguments) const {
    return Process(directory / "", name, programs + "/proofmass", arguments).wait();
  }
  int remote_command(Arguments arguments) const {
    arguments.insert(arguments.end(), {"--connect", "ipc://" + path("served/clients").string()});
    return command("remote", arguments);
  }
  [[nodiscard]] std::string output_of(const std::string& name) const {
    return read_file(path(name + ".out"));
  }

  /// The command with the campaign's name asks the coordinator, that with the file reads it.
  void expect_same(const Arguments& before, const Arguments& after, int exit_code) const {
    Arguments remote = before;
    remote.emplace_back("hardy2013");
    remote.insert(remote.end(), after.begin(), after.end());
    Arguments local = before;
    local.emplace_back("served/hardy2013.db");
    local.insert(local.end(), after.begin(), after.end());
    EXPECT_EQ(remote_command(remote), exit_code) << errors_of("remote");
    EXPECT_EQ(command("local", local), exit_code) << errors_of("local");
    EXPECT_EQ(output_of("remote"), output_of("local"));
    EXPECT_FALSE(output_of("remote").empty() && exit_code == 0);
    EXPECT_EQ(errors_of("remote"), errors_of("local"));
  }

 private:
  std::unique_ptr<Process> coordinator_;
  std::unique_ptr<Process> worker_;
};

TEST_F(RemoteResults, AreThoseOfTheFile) {
  expect_same({"report"}, {}, 0);
  expect_same({"report"}, {"--json", "--requirement", "a_c12 < 1 for 50% with 50%"}, 0);
  expect_same({"report"}, {"--requirement", "a_c12 < 1e-9 for 99% with 95%"}, 3);
  expect_same({"sensitivity"}, {"--run", "13", "--rows", "2"}, 0);
  expect_same({"sensitivity"}, {"--parameter", "k2c", "--json"}, 0);
  const std::string rows = "SELECT run_index, status FROM run_result";
  expect_same({"query"}, {rows, "--format", "csv"}, 0);
  expect_same({"query"}, {rows, "--format", "json"}, 0);
  expect_same({"query"}, {rows, "--rows-max", "3"}, 0);
  expect_same({"query"}, {"SELECT * FROM parameter_accuracy", "--columns", "60"}, 0);
  expect_same({"query"}, {"SELEC 1"}, 2);
  expect_same({"query"}, {"DELETE FROM run_result"}, 2);
  expect_same({"report"}, {"--requirement", "a_c99 < 1"}, 2);
}

TEST_F(RemoteResults, EndAQueryThatTakesTooLong) {
  const std::string endless =
      "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT max(i) FROM n";
  expect_same({"query"}, {endless, "--timeout", "0.2"}, 1);
}

TEST_F(RemoteResults, AreAWholeDatabaseOnceFetched) {
  ASSERT_EQ(remote_command({"fetch", "hardy2013", "copy.db"}), 0) << errors_of("remote");
  EXPECT_TRUE(output_of("remote").starts_with("wrote copy.db: 64 results\nDigest "));
  EXPECT_EQ(stored_runs(path("copy.db")), stored_runs(path("served/hardy2013.db")));
  EXPECT_EQ(command("verify", {"verify", "copy.db"}), 0) << output_of("verify");
  EXPECT_EQ(remote_command({"fetch", "hardy2013", "copy.db"}), 2);
  EXPECT_EQ(errors_of("remote"), "proofmass: error: file = copy.db (exists already)\n");
}

// The first half of a fetch that was interrupted, or of a copy that is another one by now.
TEST_F(RemoteResults, GoOnWithAFetchThatWasInterrupted) {
  ASSERT_EQ(remote_command({"fetch", "hardy2013", "whole.db"}), 0) << errors_of("remote");
  const std::string whole = read_file(path("whole.db"));
  for (const std::string& beginning :
       {whole.substr(0, whole.size() / 2), whole, std::string("another file"), whole + "more"}) {
    std::ofstream(path("copy.db.part"), std::ios::binary) << beginning;
    ASSERT_EQ(remote_command({"fetch", "hardy2013", "copy.db"}), 0) << errors_of("remote");
    EXPECT_EQ(stored_runs(path("copy.db")), stored_runs(path("served/hardy2013.db")));
    EXPECT_FALSE(std::filesystem::exists(path("copy.db.part")));
    std::filesystem::remove(path("copy.db"));
  }
}

// SQLite would apply it to the copy.
TEST_F(RemoteResults, AreNotFetchedBesideTheJournalOfAFileThatIsGone) {
  std::ofstream(path("copy.db-journal")) << "pages of the file that is gone";
  EXPECT_EQ(remote_command({"fetch", "hardy2013", "copy.db"}), 1);
  EXPECT_EQ(errors_of("remote"),
            "proofmass: error: campaign database = copy.db (is gone, but its journal "
            "copy.db-journal is there: put the file back, or move copy.db-journal away and begin "
            "anew)\n");
  EXPECT_FALSE(std::filesystem::exists(path("copy.db")));
  EXPECT_FALSE(std::filesystem::exists(path("copy.db.part")));
}

TEST_F(RemoteResults, SayThatACopyHasNoPlace) {
  EXPECT_EQ(remote_command({"fetch", "hardy2013", "missing/copy.db"}), 1);
  EXPECT_EQ(errors_of("remote"),
            "proofmass: error: file = missing/copy.db (its directory does not exist)\n");
}

TEST_F(RemoteResults, AreNotServedOnceArchivedAndReturnWithTheFile) {
  const auto runs = stored_runs(path("served/hardy2013.db"));
  EXPECT_EQ(remote_command({"archive", "hardy2013"}), 0) << errors_of("remote");
  EXPECT_EQ(output_of("remote"), "campaign hardy2013: its database is archived/hardy2013.db now\n");
  EXPECT_EQ(remote_command({"status"}), 0);
  EXPECT_TRUE(contains(output_of("remote"), "no campaigns")) << output_of("remote");
  EXPECT_EQ(stored_runs(path("served/archived/hardy2013.db")), runs);
  EXPECT_EQ(remote_command({"report", "hardy2013"}), 1);
  EXPECT_EQ(errors_of("remote"), "proofmass: error: campaign = hardy2013 (is not served)\n");
  std::filesystem::rename(path("served/archived/hardy2013.db"), path("served/hardy2013.db"));
  wait_until("the campaign", [&] { return remote_command({"report", "hardy2013"}) == 0; });
}

TEST_F(RemoteResults, StayInTheListIfTheArchiveHasSuchAFile) {
  std::filesystem::create_directory(path("served/archived"));
  std::ofstream(path("served/archived/hardy2013.db")) << "an older one";
  EXPECT_EQ(remote_command({"archive", "hardy2013"}), 1);
  EXPECT_EQ(errors_of("remote"),
            "proofmass: error: archived file = archived/hardy2013.db (File exists)\n");
  EXPECT_EQ(read_file(path("served/archived/hardy2013.db")), "an older one");
  EXPECT_EQ(remote_command({"report", "hardy2013"}), 0) << errors_of("remote");
}

TEST_F(RemoteResults, ArriveWhileTheClientWaits) {
  EXPECT_EQ(remote_command({"submit", "small.toml", "--name", "second", "--wait"}), 0)
      << errors_of("remote");
  EXPECT_TRUE(output_of("remote").starts_with("campaign second: active, 64 runs, 0 of them"));
  EXPECT_TRUE(contains(output_of("remote"), "second finished: 64 of 64 runs, 100 %\n"));
}

TEST_F(RemoteResults, OfAnActiveCampaignCannotBeArchived) {
  ASSERT_EQ(remote_command({"submit", "small.toml", "--name", "long", "--runs", "100000"}), 0);
  EXPECT_EQ(remote_command({"archive", "long"}), 1);
  EXPECT_EQ(errors_of("remote"),
            "proofmass: error: campaign = long (is not finished; cancel it first)\n");
  ASSERT_EQ(remote_command({"cancel", "long"}), 0);
  wait_until("the archive", [&] { return remote_command({"archive", "long"}) == 0; });
  EXPECT_TRUE(std::filesystem::exists(path("served/archived/long.db")));
}

/// Commands that a coordinator starts.
class NoticeCommand : public CampaignProcess {
 protected:
  /// Serves a campaign to its end, or until it fails.
  int serve(const Arguments& options) const {
    const std::string endpoint = "ipc://" + path("socket").string();
    Arguments arguments{"--directory", "served", "--bind", endpoint, "--exit-when-done"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    Process coordinator(directory / "", "coordinator", programs + "/proofmass-coordinator",
                        arguments);
    const Process worker(directory / "", "worker", programs + "/proofmass-worker",
                         {"--connect", endpoint, "--threads", "1"});
    return coordinator.wait();
  }
};

TEST_F(NoticeCommand, FindsTheFinishedCampaignWithItsStatistics) {
  const std::string command = "echo $PROOFMASS_CAMPAIGN >ended; " + programs +
                              "/proofmass report $PROOFMASS_DATABASE >>ended";
  EXPECT_EQ(serve({"short.toml", "--on-finish", command, "--on-failure", "touch failed"}), 0);
  EXPECT_TRUE(read_file(path("ended")).starts_with("hardy2013\nCampaign  hardy2013\n"));
  EXPECT_FALSE(std::filesystem::exists(path("failed")));
}

TEST_F(NoticeCommand, IsNotStartedAgainForACampaignThatHadEnded) {
  EXPECT_EQ(serve({"short.toml", "--on-finish", "echo once >>ended"}), 0);
  EXPECT_EQ(serve({"--on-finish", "echo once >>ended"}), 0);
  EXPECT_EQ(read_file(path("ended")), "once\n");
}

TEST_F(NoticeCommand, ThatFailsIsLogged) {
  EXPECT_EQ(serve({"short.toml", "--on-finish", "exit 7"}), 0);
  EXPECT_TRUE(
      contains(errors_of("coordinator"),
               "command_failed command=on-finish campaign=hardy2013 reason=\"exit code 7\""))
      << errors_of("coordinator");
}

}  // namespace
}  // namespace proofmass::test
