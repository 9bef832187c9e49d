// The coordinator's service with workers and clients, all of them real processes.

#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <utility>
#include <vector>

#include "tests/proto/link/notice_receiver.hpp"
#include "tests/system/campaign_process.hpp"

namespace proofmass::test {
namespace {

/// The three programs by hand.
class CoordinatorProcess : public CampaignProcess {
 protected:
  [[nodiscard]] std::string endpoint() const { return "ipc://" + path("socket").string(); }
  [[nodiscard]] std::string clients_endpoint() const {
    return "ipc://" + path("served/clients").string();
  }

  [[nodiscard]] Process start_coordinator(const Arguments& further = {"short.toml"}) const {
    Arguments arguments{"--directory", "served", "--bind", endpoint(), "--exit-when-done"};
    arguments.insert(arguments.end(), further.begin(), further.end());
    const bool has_faults = std::ranges::find(further, "--faults") != further.end();
    return Process(directory / "", "coordinator",
                   programs + "/proofmass-coordinator" + (has_faults ? "-with-faults" : ""),
                   arguments);
  }
  [[nodiscard]] Process start_worker(const std::string& name,
                                     const std::string& num_threads = "1") const {
    return Process(directory / "", name, programs + "/proofmass-worker",
                   {"--connect", endpoint(), "--name", name, "--threads", num_threads});
  }

  /// Another campaign with the same runs.
  void write_campaign(const std::string& name, std::size_t count) const {
    std::string text = read_file(path("short.toml"));
    text = std::regex_replace(text, std::regex("\nname = \"[^\"]*\""), "\nname = \"" + name + "\"",
                              std::regex_constants::format_first_only);
    text = std::regex_replace(text, std::regex("\nruns = [0-9]+"),
                              "\nruns = " + std::to_string(count));
    std::ofstream(path(name + ".toml")) << text;
  }

  static constexpr const char* served = "served/hardy2013";
};

TEST_F(CoordinatorProcess, ServesWorkersThatConnectAndLeave) {
  Process early = start_worker("early");  // It waits for its coordinator.
  Process coordinator = start_coordinator();
  wait_for_runs(served, 1);
  Process late = start_worker("late");
  wait_for_runs(served, 2);
  early.signal(SIGTERM);
  EXPECT_EQ(early.wait(), 0) << errors_of("early");
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(late.wait(), 0) << errors_of("late");
  EXPECT_EQ(stored_runs(path("served/hardy2013.db")), reference());
}

/// Processes with an init system that listens to them.
class NoticedProcess : public CoordinatorProcess {
 protected:
  [[nodiscard]] Process start_noticed(const std::string& name, const Arguments& command) const {
    Arguments words{"NOTIFY_SOCKET=" + path("notify").string(), "WATCHDOG_USEC=200000"};
    words.insert(words.end(), command.begin(), command.end());
    return Process(directory / "", name, "/usr/bin/env", words);
  }
  void wait_for_notice(const std::string& notice) {
    wait_until(notice, [&] { return contains(told += init_system_.receive() + '\n', notice); });
  }

  std::string told;  ///< All notices so far.

 private:
  NoticeReceiver init_system_{path("notify").string()};
};

TEST_F(NoticedProcess, OfTheCoordinatorTellsHowItIs) {
  Process coordinator =
      start_noticed("coordinator", {programs + "/proofmass-coordinator", "--directory", "served",
                                    "--bind", endpoint(), "short.toml"});
  wait_for_notice("READY=1\n");
  EXPECT_TRUE(std::filesystem::exists(path("socket")));
  wait_for_notice("STATUS=1 campaigns to compute\n");
  wait_for_notice("WATCHDOG=1\n");
  EXPECT_FALSE(contains(told, "STOPPING=1"));
  coordinator.signal(SIGTERM);
  wait_for_notice("STOPPING=1\n");
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
}

TEST_F(NoticedProcess, OfAWorkerTellsHowItIs) {
  Process worker = start_noticed(
      "worker", {programs + "/proofmass-worker", "--connect", endpoint(), "--name", "worker"});
  wait_for_notice("STATUS=not registered, 0 runs at hand");
  wait_for_notice("WATCHDOG=1\n");
  EXPECT_FALSE(contains(told, "READY=1"));  // Not before a coordinator knows it.
  Process coordinator = start_coordinator();
  wait_for_notice("READY=1\n");
  EXPECT_FALSE(contains(told, "STOPPING=1"));
  worker.signal(SIGTERM);
  wait_for_notice("STOPPING=1\n");
  EXPECT_EQ(worker.wait(), 0) << errors_of("worker");
  coordinator.signal(SIGTERM);
  (void)coordinator.wait();
}

TEST_F(CoordinatorProcess, ThreeThreadsOfAWorkerGiveTheBitsOfOneAndThriceItsTimeAtMost) {
  const auto begin = std::chrono::steady_clock::now();
  Process worker = start_worker("threads", "3");
  Process coordinator = start_coordinator();
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(worker.wait(), 0) << errors_of("threads");
  EXPECT_TRUE(contains(errors_of("coordinator"), "name=threads ")) << errors_of("coordinator");
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  const auto file = path("served/hardy2013.db");
  EXPECT_EQ(stored_runs(file), reference());
  const std::string query = "SELECT CAST(1000 * compute_s AS INTEGER) FROM worker_throughput";
  EXPECT_LE(std::stod(stored_text(file, query)), 3000.0 * elapsed.count());
}

TEST_F(CoordinatorProcess, RefusesMoreThreadsThanAWorkerMayHave) {
  for (const std::string num_threads : {"0", "257"}) {
    Process worker = start_worker("many", num_threads);
    EXPECT_EQ(worker.wait(), 2) << num_threads;
    EXPECT_TRUE(contains(errors_of("many"), "--threads")) << errors_of("many");
  }
}

TEST_F(CoordinatorProcess, DrainsOnSigtermAndResumes) {
  Process worker = start_worker("first");
  Process coordinator = start_coordinator();
  wait_for_runs(served, 1);
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 130) << errors_of("coordinator");
  EXPECT_EQ(worker.wait(), 0) << errors_of("first");
  ASSERT_LT(num_stored(path("served/hardy2013.db")), num_runs);

  Process second = start_worker("second");
  Process resumed = start_coordinator({});  // It finds the campaign in its directory.
  EXPECT_EQ(resumed.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(second.wait(), 0) << errors_of("second");
  EXPECT_EQ(stored_runs(path("served/hardy2013.db")), reference());
}

// The workers keep what they hold and what they finished, register with the new coordinator and go
// on: no run was lost, none was computed twice.
TEST_F(CoordinatorProcess, MayBeKilledAndStartedAgainUnderItsWorkers) {
  Process first = start_worker("first");
  Process second = start_worker("second");
  {
    Process coordinator = start_coordinator();
    wait_for_runs(served, 2);
    coordinator.signal(SIGKILL);
    EXPECT_EQ(coordinator.wait(), -SIGKILL);
  }
  Process coordinator = start_coordinator();
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(first.wait(), 0) << errors_of("first");
  EXPECT_EQ(second.wait(), 0) << errors_of("second");
  EXPECT_EQ(stored_runs(path("served/hardy2013.db")), reference());
  const auto file = path("served/hardy2013.db");
  EXPECT_EQ(stored_text(file, "SELECT count(*) FROM attempt WHERE reason <> 'retracted'"), "0");
  EXPECT_EQ(stored_text(file, "SELECT sum(num_results) FROM worker"), std::to_string(num_runs));
  EXPECT_EQ(stored_text(file, "SELECT count(*) FROM worker"), "2");
  EXPECT_EQ(stored_text(file, "SELECT count(*) FROM coordinator_start"), "2");
  EXPECT_EQ(stored_text(file, "SELECT count(*) FROM coordinator_start WHERE ended_utc IS NULL"),
            "1");
}

// SIGHUP is the planned restart.
TEST_F(CoordinatorProcess, MayBeRestartedUnderItsWorkers) {
  Process worker = start_worker("worker");
  {
    Process coordinator = start_coordinator();
    wait_for_runs(served, 2);
    coordinator.signal(SIGHUP);
    EXPECT_EQ(coordinator.wait(), 130) << errors_of("coordinator");
  }
  ASSERT_LT(num_stored(path("served/hardy2013.db")), num_runs);
  Process coordinator = start_coordinator();
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(worker.wait(), 0) << errors_of("worker");
  const auto file = path("served/hardy2013.db");
  EXPECT_EQ(stored_text(file, "SELECT count(*) FROM worker"), "1");
  EXPECT_EQ(stored_text(file, "SELECT count(*) FROM attempt"), "0");
}

class CoordinatorKilled : public CoordinatorProcess,
                          public testing::WithParamInterface<std::string> {};

TEST_P(CoordinatorKilled, LosesNothing) {
  Process first = start_worker("first");
  Process second = start_worker("second");
  Process killed = start_coordinator({"short.toml", "--faults", "kill=" + GetParam()});
  EXPECT_EQ(killed.wait(), -SIGKILL) << errors_of("coordinator");
  ASSERT_LT(num_stored(path("served/hardy2013.db")), num_runs);
  Process coordinator = start_coordinator();
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(first.wait(), 0) << errors_of("first");
  EXPECT_EQ(second.wait(), 0) << errors_of("second");
  EXPECT_EQ(stored_runs(path("served/hardy2013.db")), reference());
}

INSTANTIATE_TEST_SUITE_P(AtEachNamedPoint, CoordinatorKilled,
                         testing::Values("after_open:1", "after_lend:3", "after_receive:1",
                                         "after_receive:3", "before_commit:2", "after_commit:1",
                                         "after_commit:3", "after_acknowledge:2"),
                         [](const auto& point) {
                           return std::regex_replace(point.param, std::regex(":"), "_");
                         });

TEST_F(CoordinatorProcess, KilledWhileItMakesAFileLeavesNoHalfFile) {
  Process killed = start_coordinator({"short.toml", "--faults", "kill=while_migrating:1"});
  EXPECT_EQ(killed.wait(), -SIGKILL) << errors_of("coordinator");
  EXPECT_FALSE(std::filesystem::exists(path("served/hardy2013.db")));
  Process worker = start_worker("worker");
  Process coordinator = start_coordinator({"short.toml"});
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(stored_runs(path("served/hardy2013.db")), reference());
}

// What tests can make go wrong nobody else can.
TEST_F(CoordinatorProcess, HasNoFaultsWhereItIsInstalled) {
  for (const auto& [name, address] : {std::pair<std::string, std::string>("coordinator", "--bind"),
                                      {"worker", "--connect"}}) {
    Process program(directory / "", "program", programs + "/proofmass-" + name,
                    {address, endpoint(), "--faults", "drop=0.5"});
    EXPECT_EQ(program.wait(), 2);
    EXPECT_TRUE(contains(errors_of("program"), "--faults")) << errors_of("program");
  }
}

TEST_F(CoordinatorProcess, LosesNothingOnABadNetwork) {
  Process first = start_worker("first");
  Process second = start_worker("second");
  Process coordinator = start_coordinator(
      {"short.toml", "--faults", "seed=5,drop=0.05,delay=0.2:0.5,duplicate=0.1,reorder=0.1"});
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(stored_runs(path("served/hardy2013.db")), reference());
}

TEST_F(CoordinatorProcess, ServesTheCampaignOfHigherPriorityFirst) {
  write_campaign("low", 64);
  write_campaign("high", 64);
  Process coordinator = start_coordinator({"low.toml"});
  wait_until("campaign database", [&] { return std::filesystem::exists(path("served/low.db")); });
  Process submit(directory / "", "submit", programs + "/proofmass",
                 {"submit", "high.toml", "--priority", "5", "--connect", clients_endpoint()});
  ASSERT_EQ(submit.wait(), 0) << errors_of("submit");
  Process worker = start_worker("worker");
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(num_stored(path("served/low.db")), 64U);
  EXPECT_EQ(num_stored(path("served/high.db")), 64U);
  const auto received = [&](const std::string& which, const std::string& campaign) {
    const std::string query = "SELECT " + which + "(received_unix_s) FROM delivery";
    return std::stoll(stored_text(path("served/" + campaign + ".db"), query));
  };
  EXPECT_LE(received("max", "high"), received("min", "low"));
}

TEST_F(CoordinatorProcess, IsTheOnlyOneOfItsDirectory) {
  Process coordinator = start_coordinator();
  wait_until("campaign database",
             [&] { return std::filesystem::exists(path("served/hardy2013.db")); });
  Process second(directory / "", "second", programs + "/proofmass-coordinator",
                 {"--directory", "served", "--bind", "ipc://" + path("other").string()});
  EXPECT_EQ(second.wait(), 1);
  EXPECT_EQ(errors_of("second"),
            "proofmass-coordinator: error: directory = served (another coordinator serves it)\n");
}

TEST_F(CoordinatorProcess, TakesItsOptionsFromAFileAndTheEnvironment) {
  std::ofstream(path("coordinator.toml"))
      << "directory = \"served\"\nbind = \"" << endpoint() << "\"\nlog-format = \"json\"\n";
  Process coordinator(directory / "", "configured", programs + "/proofmass-coordinator",
                      {"--config", "coordinator.toml"});
  wait_until("start", [&] { return contains(errors_of("configured"), "coordinator_started"); });
  EXPECT_TRUE(contains(errors_of("configured"), "\"bind\":\"" + endpoint() + "\""))
      << errors_of("configured");
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 0);
}

TEST_F(CoordinatorProcess, RefusesAnAddressThatOthersCanReach) {
  Process coordinator(directory / "", "open", programs + "/proofmass-coordinator",
                      {"short.toml", "--directory", "served", "--bind", "tcp://0.0.0.0:7001"});
  EXPECT_EQ(coordinator.wait(), 2);
  EXPECT_TRUE(contains(errors_of("open"), "bind = tcp://0.0.0.0:7001 (")) << errors_of("open");
  Process worker(directory / "", "far", programs + "/proofmass-worker",
                 {"--connect", "tcp://10.0.0.1:7001"});
  EXPECT_EQ(worker.wait(), 2);
  EXPECT_TRUE(contains(errors_of("far"), "connect = tcp://10.0.0.1:7001 (")) << errors_of("far");
}

}  // namespace
}  // namespace proofmass::test
