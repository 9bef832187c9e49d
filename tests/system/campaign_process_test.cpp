// Whole campaigns with real processes, which are killed and interrupted. What is compared is every
// column of run_result, doubles by their bits.

#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <vector>

#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/system/process.hpp"
#include "tests/system/stored_runs.hpp"

namespace proofmass::test {
namespace {

using Arguments = std::vector<std::string>;
using testing::Test;

const std::string programs = PROOFMASS_PROGRAMS;
constexpr std::size_t num_runs = 320;  // 20 batches, so that there is an end to be killed before.

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// A directory with a campaign whose batches take a tenth of a second or two: the paper's, with
/// sessions of two orbits.
class CampaignProcess : public Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(
        Process(directory / "", "init", programs + "/proofmass", {"init", "paper.toml"}).wait(), 0);
    std::string text = read_file(directory / "paper.toml");
    text = std::regex_replace(text, std::regex("\norbits = [0-9]+"), "\norbits = 2");
    text = std::regex_replace(text, std::regex("\nruns = [0-9]+"),
                              "\nruns = " + std::to_string(num_runs));
    text = std::regex_replace(text, std::regex("\nsample_period_s = [0-9.]+"),
                              "\nsample_period_s = 1");
    std::ofstream(directory / "short.toml") << text;
  }

  [[nodiscard]] std::filesystem::path path(const std::string& name) const {
    return directory / name;
  }

  /// `proofmass run short.toml --db NAME.db` with further arguments; output in NAME.out, NAME.err.
  [[nodiscard]] Process start(const std::string& name, const Arguments& further) const {
    Arguments arguments{"run", "short.toml", "--db", name + ".db"};
    arguments.insert(arguments.end(), further.begin(), further.end());
    return Process(directory / "", name, programs + "/proofmass", arguments);
  }

  [[nodiscard]] std::string errors_of(const std::string& name) const {
    return read_file(path(name + ".err"));
  }

  /// The whole campaign, by one worker, undisturbed.
  [[nodiscard]] std::map<std::int64_t, StoredRun> reference() const {
    EXPECT_EQ(start("reference", {"--workers", "1"}).wait(), 0) << errors_of("reference");
    auto runs = stored_runs(path("reference.db"));
    EXPECT_EQ(runs.size(), num_runs);
    return runs;
  }

  /// Waits until so many runs are stored while the campaign goes on.
  void wait_for_runs(const std::string& name, std::size_t count) const {
    wait_until("stored runs", [&] { return num_stored(path(name + ".db")) >= count; });
  }

  TemporaryDirectory directory;
};

TEST_F(CampaignProcess, ARunAloneHasTheBitsThatItHasInACampaign) {
  EXPECT_EQ(start("alone", {"--runs", "1"}).wait(), 0) << errors_of("alone");
  const auto alone = stored_runs(path("alone.db"));
  ASSERT_EQ(alone.size(), 1U);
  EXPECT_EQ(alone.at(0), reference().at(0));
}

TEST_F(CampaignProcess, ThreeWorkersGiveTheBitsOfOne) {
  EXPECT_EQ(start("three", {"--workers", "3"}).wait(), 0) << errors_of("three");
  EXPECT_EQ(stored_runs(path("three.db")), reference());
}

TEST_F(CampaignProcess, AnotherSeedGivesOtherResults) {
  EXPECT_EQ(start("other", {"--seed", "2", "--runs", "1"}).wait(), 0);
  EXPECT_NE(stored_runs(path("other.db")).at(0), reference().at(0));
}

TEST_F(CampaignProcess, ReplacesAWorkerThatIsKilled) {
  Process run = start("killed", {"--workers", "2"});
  wait_for_runs("killed", 2);
  const std::vector<pid_t> workers = run.children();
  ASSERT_EQ(workers.size(), 2U);
  kill(workers[0], SIGKILL);
  EXPECT_EQ(run.wait(), 0) << errors_of("killed");
  const std::string note =
      "(pid " + std::to_string(workers[0]) + ") ended: killed by signal 9 (Killed); it held runs ";
  EXPECT_TRUE(contains(errors_of("killed"), note)) << errors_of("killed");
  EXPECT_EQ(stored_runs(path("killed.db")), reference());
}

TEST_F(CampaignProcess, ResumesAfterEverythingWasKilled) {
  Process run = start("resumed", {"--workers", "2"});
  wait_for_runs("resumed", 2);
  run.signal_all(SIGKILL);
  EXPECT_EQ(run.wait(), -SIGKILL);
  const auto before = stored_runs(path("resumed.db"));
  ASSERT_LT(before.size(), num_runs);

  EXPECT_EQ(start("resumed", {"--workers", "2"}).wait(), 0) << errors_of("resumed");
  EXPECT_EQ(stored_runs(path("resumed.db")), reference());
}

TEST_F(CampaignProcess, LeavesNoWorkersWhenItIsKilledAlone) {
  Process run = start("orphans", {"--workers", "2"});
  wait_for_runs("orphans", 1);
  const std::vector<pid_t> workers = run.children();
  ASSERT_EQ(workers.size(), 2U);
  run.signal(SIGKILL);
  EXPECT_EQ(run.wait(), -SIGKILL);
  for (const pid_t worker : workers) {
    wait_until("end of the workers", [&] { return !is_alive(worker); });
  }
}

TEST_F(CampaignProcess, CanBeInterruptedAndResumed) {
  Process run = start("interrupted", {"--workers", "2"});
  wait_for_runs("interrupted", 2);
  const std::vector<pid_t> workers = run.children();
  run.signal_all(SIGINT);
  EXPECT_EQ(run.wait(), 130) << errors_of("interrupted");
  EXPECT_TRUE(contains(errors_of("interrupted"), "the same command computes the others"));
  EXPECT_EQ(read_file(path("interrupted.out")), "");
  for (const pid_t worker : workers) EXPECT_FALSE(is_alive(worker));
  const std::size_t num_before = num_stored(path("interrupted.db"));
  ASSERT_GE(num_before, 2U);
  ASSERT_LT(num_before, num_runs);

  EXPECT_EQ(start("interrupted", {"--workers", "2"}).wait(), 0) << errors_of("interrupted");
  const std::string first_line = std::to_string(num_before) + "/" + std::to_string(num_runs);
  EXPECT_EQ(errors_of("interrupted").find(first_line), 0U) << "it does the missing runs only";
  EXPECT_EQ(stored_runs(path("interrupted.db")), reference());
}

TEST_F(CampaignProcess, AFinishedCampaignPrintsItsTablesAgain) {
  EXPECT_EQ(start("again", {"--runs", "2"}).wait(), 0);
  const std::string tables = read_file(path("again.out"));
  EXPECT_TRUE(contains(tables, "Accuracy"));
  EXPECT_EQ(start("again", {"--runs", "2"}).wait(), 0);
  EXPECT_EQ(read_file(path("again.out")), tables);
  EXPECT_EQ(
      Process(directory / "", "report", programs + "/proofmass", {"report", "again.db"}).wait(), 0);
  EXPECT_EQ(read_file(path("report.out")), tables);
}

TEST_F(CampaignProcess, ALargerNumberOfRunsExtendsIt) {
  EXPECT_EQ(start("extended", {"--runs", "3"}).wait(), 0);
  EXPECT_EQ(num_stored(path("extended.db")), 3U);
  EXPECT_EQ(start("extended", {}).wait(), 0) << errors_of("extended");
  EXPECT_EQ(stored_runs(path("extended.db")), reference());
}

TEST_F(CampaignProcess, ASmallerNumberOfRunsIsRefused) {
  EXPECT_EQ(start("smaller", {"--runs", "2"}).wait(), 0);
  EXPECT_EQ(start("smaller", {"--runs", "1"}).wait(), 2);
  EXPECT_EQ(errors_of("smaller"),
            "proofmass: error: runs = 1 (must be at least 2, the number that smaller.db was asked "
            "for)\n");
}

TEST_F(CampaignProcess, RefusesTheDatabaseOfAnotherCampaign) {
  EXPECT_EQ(start("wrong", {"--runs", "1"}).wait(), 0);
  const auto before = stored_runs(path("wrong.db"));
  EXPECT_EQ(start("wrong", {"--runs", "1", "--seed", "5", "--set", "noise.scale=0"}).wait(), 2);
  EXPECT_TRUE(contains(errors_of("wrong"), "proofmass: error: wrong.db holds another campaign:"));
  EXPECT_TRUE(contains(errors_of("wrong"), "seed: 1 in the database, 5 asked for"));
  EXPECT_TRUE(contains(errors_of("wrong"), "noise.scale: 1 in the database, 0 asked for"));
  EXPECT_EQ(stored_runs(path("wrong.db")), before);
}

TEST_F(CampaignProcess, GivesUpIfWorkersDieAgainAndAgain) {
  Process run = start("dying", {"--workers", "1", "--set", "simulation.sample_period_s=0.05"});
  while (!run.has_ended()) {
    for (const pid_t worker : run.children()) kill(worker, SIGKILL);
  }
  EXPECT_EQ(run.wait(), 1);
  EXPECT_TRUE(contains(errors_of("dying"),
                       "proofmass: error: 3 workers in a row ended without a finished run; the "
                       "last, local-1: killed by signal 9 (Killed), holding runs "))
      << errors_of("dying");
}

TEST_F(CampaignProcess, ShowsNothingIfQuiet) {
  EXPECT_EQ(start("quiet", {"--runs", "1", "--quiet"}).wait(), 0);
  EXPECT_EQ(errors_of("quiet"), "");
}

TEST_F(CampaignProcess, RefusesWrongUsageBeforeAnythingStarts) {
  EXPECT_EQ(start("usage", {"--worker", "1"}).wait(), 2);
  EXPECT_EQ(start("usage", {"--workers", "0"}).wait(), 2);
  EXPECT_EQ(
      Process(directory / "", "bench", programs + "/proofmass", {"bench", "--runs", "0"}).wait(),
      2);
  EXPECT_EQ(start("usage", {"--set", "noise.scal=0"}).wait(), 2);
  EXPECT_EQ(errors_of("usage"),
            "proofmass: error: --set noise.scal=0: unknown key; nearest is noise.scale\n");
  EXPECT_FALSE(std::filesystem::exists(path("usage.db")));
}

TEST_F(CampaignProcess, SaysWhenADatabaseCannotBeMade) {
  Process run(directory / "", "nowhere", programs + "/proofmass",
              {"run", "short.toml", "--db", "missing/a.db"});
  EXPECT_EQ(run.wait(), 1);
  EXPECT_TRUE(contains(errors_of("nowhere"), "proofmass: error: ")) << errors_of("nowhere");
}

TEST_F(CampaignProcess, SaysItsVersion) {
  Process run(directory / "", "version", programs + "/proofmass", {"--version"});
  EXPECT_EQ(run.wait(), 0);
  EXPECT_EQ(read_file(path("version.out")), "proofmass " PROOFMASS_VERSION "\n");
}

/// The three programs by hand.
class CoordinatorProcess : public CampaignProcess {
 protected:
  [[nodiscard]] std::string endpoint() const { return "ipc://" + path("socket").string(); }

  [[nodiscard]] Process start_coordinator() const {
    return Process(directory / "", "coordinator", programs + "/proofmass-coordinator",
                   {"short.toml", "--db", "served.db", "--bind", endpoint()});
  }
  [[nodiscard]] Process start_worker(const std::string& name,
                                     const std::string& num_threads = "1") const {
    return Process(directory / "", name, programs + "/proofmass-worker",
                   {"--connect", endpoint(), "--name", name, "--threads", num_threads});
  }
};

TEST_F(CoordinatorProcess, ServesWorkersThatConnectAndLeave) {
  Process early = start_worker("early");  // It waits for its coordinator.
  Process coordinator = start_coordinator();
  wait_for_runs("served", 1);
  Process late = start_worker("late");
  wait_for_runs("served", 2);
  early.signal(SIGTERM);
  EXPECT_EQ(early.wait(), 0) << errors_of("early");
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(late.wait(), 0) << errors_of("late");
  EXPECT_EQ(stored_runs(path("served.db")), reference());
}

TEST_F(CoordinatorProcess, ThreeThreadsOfAWorkerGiveTheBitsOfOne) {
  Process worker = start_worker("threads", "3");
  Process coordinator = start_coordinator();
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(worker.wait(), 0) << errors_of("threads");
  EXPECT_TRUE(contains(errors_of("coordinator"), "name=threads ")) << errors_of("coordinator");
  EXPECT_TRUE(contains(errors_of("coordinator"), " slots=48")) << errors_of("coordinator");
  EXPECT_EQ(stored_runs(path("served.db")), reference());
}

TEST_F(CoordinatorProcess, RefusesMoreThreadsThanAWorkerMayHave) {
  for (const std::string num_threads : {"0", "65"}) {
    Process worker = start_worker("many", num_threads);
    EXPECT_EQ(worker.wait(), 2) << num_threads;
    EXPECT_TRUE(contains(errors_of("many"), "--threads")) << errors_of("many");
  }
}

TEST_F(CoordinatorProcess, DrainsOnSigtermAndResumes) {
  Process worker = start_worker("first");
  Process coordinator = start_coordinator();
  wait_for_runs("served", 1);
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 130) << errors_of("coordinator");
  EXPECT_EQ(worker.wait(), 0) << errors_of("first");
  ASSERT_LT(num_stored(path("served.db")), num_runs);

  Process second = start_worker("second");
  Process resumed = start_coordinator();
  EXPECT_EQ(resumed.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(second.wait(), 0) << errors_of("second");
  EXPECT_EQ(stored_runs(path("served.db")), reference());
}

// The worker keeps its results, registers with the new coordinator and goes on.
TEST_F(CoordinatorProcess, MayBeKilledAndStartedAgainUnderItsWorkers) {
  Process worker = start_worker("faithful");
  {
    Process coordinator = start_coordinator();
    wait_for_runs("served", 2);
    coordinator.signal(SIGKILL);
    EXPECT_EQ(coordinator.wait(), -SIGKILL);
  }
  Process coordinator = start_coordinator();
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(worker.wait(), 0) << errors_of("faithful");
  EXPECT_EQ(stored_runs(path("served.db")), reference());
}

TEST_F(CoordinatorProcess, RefusesAnAddressThatOthersCanReach) {
  Process coordinator(directory / "", "open", programs + "/proofmass-coordinator",
                      {"short.toml", "--db", "served.db", "--bind", "tcp://0.0.0.0:7001"});
  EXPECT_EQ(coordinator.wait(), 2);
  EXPECT_TRUE(contains(errors_of("open"), "bind = tcp://0.0.0.0:7001 (must be on loopback"));
  Process worker(directory / "", "far", programs + "/proofmass-worker",
                 {"--connect", "tcp://10.0.0.1:7001"});
  EXPECT_EQ(worker.wait(), 2);
  EXPECT_TRUE(contains(errors_of("far"), "connect = tcp://10.0.0.1:7001 (must be on loopback"));
}

}  // namespace
}  // namespace proofmass::test
