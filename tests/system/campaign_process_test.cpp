// Whole campaigns with real processes, which are killed and interrupted. What is compared is every
// column of run_result, doubles by their bits.

#include "tests/system/campaign_process.hpp"

#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <string>
#include <vector>

namespace proofmass::test {
namespace {

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

TEST_F(CampaignProcess, LeavesStatisticsOfAllResults) {
  EXPECT_EQ(start("all", {}).wait(), 0) << errors_of("all");
  EXPECT_EQ(stored_text(path("all.db"), "SELECT num_finished FROM summary"),
            std::to_string(num_runs));
  EXPECT_EQ(
      stored_text(path("all.db"), "SELECT count(*) FROM parameter_accuracy WHERE num_runs = " +
                                      std::to_string(num_runs)),
      "10");
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
  EXPECT_EQ(
      errors_of("smaller"),
      "proofmass: error: campaign.runs = 1 (must be at least 2, which smaller.db was asked for; "
      "the number comes from --runs, or else from the campaign file)\n");
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
  // After that a child is no worker: a sanitizer looks for leaks from one.
  const auto has_given_up = [&] { return contains(errors_of("dying"), "proofmass: error: "); };
  while (!run.has_ended() && !has_given_up()) {
    for (const pid_t worker : run.children()) kill(worker, SIGKILL);
  }
  EXPECT_EQ(run.wait(), 1);
  EXPECT_TRUE(contains(errors_of("dying"),
                       "proofmass: error: 3 workers in a row ended without a finished run; the "
                       "last, local-1: killed by signal 9 (Killed), holding runs "))
      << errors_of("dying");
}

/// `proofmass run` with other workers than its own: a shell script in the place of theirs.
class OtherWorkers : public CampaignProcess {
 protected:
  [[nodiscard]] Process start_with(const std::string& worker, const std::string& name) const {
    std::filesystem::create_directories(path("bin"));
    std::filesystem::copy_file(programs + "/proofmass", path("bin/proofmass"),
                               std::filesystem::copy_options::overwrite_existing);
    std::ofstream(path("bin/proofmass-worker")) << "#!/bin/sh\n" << worker << '\n';
    std::filesystem::permissions(path("bin/proofmass-worker"), std::filesystem::perms::owner_all);
    return Process(directory / "", name, path("bin/proofmass"),
                   {"run", "short.toml", "--db", "other.db", "--runs", "64", "--workers", "2"});
  }

  const std::string null_worker = "exec " + programs + "/proofmass-null-worker \"$@\"";
};

TEST_F(OtherWorkers, ThatCrashAtOneRunComputeTheOthersAndThatOneLater) {
  Process poisoned = start_with(null_worker + " --poison 17", "poisoned");
  EXPECT_EQ(poisoned.wait(), 1) << errors_of("poisoned");
  EXPECT_TRUE(contains(errors_of("poisoned"),
                       "proofmass: error: 1 of 64 runs given up, having crashed their workers: 17\n"
                       "proofmass: the same command tries them again\n"))
      << errors_of("poisoned");
  EXPECT_TRUE(contains(read_file(path("poisoned.out")), "1 given up, having crashed workers: 17"));
  EXPECT_EQ(num_stored(path("other.db")), 63U);

  Process healed = start_with(null_worker, "healed");
  EXPECT_EQ(healed.wait(), 0) << errors_of("healed");
  EXPECT_EQ(num_stored(path("other.db")), 64U);
}

TEST_F(OtherWorkers, ThatCannotStartEndTheCommand) {
  Process run = start_with("exit 7", "failing");
  EXPECT_EQ(run.wait(), 1);
  EXPECT_TRUE(contains(errors_of("failing"),
                       "proofmass: error: 3 workers in a row ended without a finished run; the "
                       "last, local-"))
      << errors_of("failing");
  EXPECT_TRUE(contains(errors_of("failing"), ": exit code 7, holding runs none"))
      << errors_of("failing");
}

TEST_F(CampaignProcess, ComputesRunsTwiceIfAskedToAudit) {
  EXPECT_EQ(start("audited", {"--runs", "32", "--workers", "2", "--audit", "0.5"}).wait(), 0)
      << errors_of("audited");
  const std::string num_audited =
      stored_text(path("audited.db"), "SELECT count(*) FROM audit WHERE is_equal = 1");
  EXPECT_GT(std::stoi(num_audited), 0);
  EXPECT_EQ(stored_text(path("audited.db"), "SELECT count(*) FROM audit WHERE is_equal = 0"), "0");
  EXPECT_EQ(num_stored(path("audited.db")), 32U);
}

TEST_F(CampaignProcess, ShowsNothingIfQuiet) {
  EXPECT_EQ(start("quiet", {"--runs", "1", "--quiet"}).wait(), 0);
  EXPECT_EQ(errors_of("quiet"), "");
}

TEST_F(CampaignProcess, RefusesWrongUsageBeforeAnythingStarts) {
  EXPECT_EQ(start("usage", {"--worker", "1"}).wait(), 2);
  EXPECT_EQ(start("usage", {"--workers", "0"}).wait(), 2);
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

}  // namespace
}  // namespace proofmass::test
