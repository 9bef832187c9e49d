// Campaigns that end before all of their runs are finished, with real processes.

#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>

#include <string>

#include "tests/system/campaign_process.hpp"

namespace proofmass::test {
namespace {

class StopRule : public CampaignProcess {
 protected:
  /// The rule of the mean of |error| of K2d. In sessions of two orbits noise makes that error: it
  /// is normal, |error| scatters by √(π/2 − 1) of its mean, and 1.96 standard errors of the mean
  /// are 13 % at 128 runs and 11 % at 192.
  [[nodiscard]] Process start_until(const std::string& name, const std::string& percent,
                                    const Arguments& further) const {
    Arguments arguments{"--until", "mean(k2d) within " + percent + "%"};
    arguments.insert(arguments.end(), further.begin(), further.end());
    return start(name, arguments);
  }

  [[nodiscard]] std::string num_checked(const std::string& name) const {
    return stored_text(path(name + ".db"), "SELECT group_concat(num_runs) FROM stop_check");
  }
};

TEST_F(StopRule, EndsAtTheSameRunForAnyWorkers) {
  EXPECT_EQ(start_until("one", "12", {"--workers", "1"}).wait(), 0) << errors_of("one");
  EXPECT_EQ(start_until("three", "12", {"--workers", "3"}).wait(), 0) << errors_of("three");
  const auto runs = stored_runs(path("one.db"));
  EXPECT_EQ(runs.size(), 192U);
  EXPECT_EQ(stored_runs(path("three.db")), runs);
  EXPECT_EQ(num_checked("three"), "128,192");
  EXPECT_TRUE(
      contains(read_file(path("one.out")), " after 192 runs; mean(k2d) within 12%: reached"));
}

TEST_F(StopRule, IsCheckedAtTheSameCountsAfterACrash) {
  Process run = start_until("killed", "12", {"--workers", "2"});
  wait_for_runs("killed", 130);
  run.signal_all(SIGKILL);
  EXPECT_EQ(run.wait(), -SIGKILL);
  EXPECT_EQ(start_until("killed", "12", {}).wait(), 0) << errors_of("killed");
  EXPECT_EQ(stored_runs(path("killed.db")).size(), 192U);
  EXPECT_EQ(num_checked("killed"), "128,192");
}

// 320 runs are all that the campaign file asks for; the last check is with those.
TEST_F(StopRule, SaysThatAllRunsAreNotEnough) {
  EXPECT_EQ(start_until("all", "1", {}).wait(), 3) << errors_of("all");
  EXPECT_EQ(stored_runs(path("all.db")).size(), num_runs);
  EXPECT_EQ(num_checked("all"), "128,192,256,320");
  EXPECT_TRUE(contains(read_file(path("all.out")), " after 320 runs; mean(k2d) within 1%: not"));
}

TEST_F(StopRule, IsFollowedByATighterOne) {
  EXPECT_EQ(start_until("tighter", "50", {}).wait(), 0) << errors_of("tighter");
  EXPECT_EQ(stored_runs(path("tighter.db")).size(), 128U);
  EXPECT_EQ(start_until("tighter", "12", {}).wait(), 0) << errors_of("tighter");
  EXPECT_EQ(stored_runs(path("tighter.db")).size(), 192U);
}

// As a program that stopped before the check may have left it.
TEST_F(StopRule, IsCheckedInAFinishedFileThatLacksTheCheck) {
  ASSERT_EQ(start_until("unchecked", "50", {}).wait(), 0) << errors_of("unchecked");
  sqlite3* file = nullptr;
  ASSERT_EQ(sqlite3_open(path("unchecked.db").c_str(), &file), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(file, "DELETE FROM stop_check", nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(file);
  EXPECT_EQ(start_until("unchecked", "50", {}).wait(), 0) << errors_of("unchecked");
  EXPECT_EQ(num_checked("unchecked"), "128");
  EXPECT_EQ(stored_runs(path("unchecked.db")).size(), 128U);
}

TEST_F(StopRule, IsRefusedIfItCannotBeRead) {
  EXPECT_EQ(start("wrong", {"--until", "soon"}).wait(), 2);
  EXPECT_TRUE(contains(errors_of("wrong"),
                       "until = soon (soon is no statistic; they are mean, std "
                       "and p1 to p99)"))
      << errors_of("wrong");
}

// A verdict of a fixed number of runs is that of a campaign that was never extended.
TEST_F(StopRule, IsWhatDecidesAfterAnExtension) {
  const auto report = [&](const std::string& name, int exit_code) {
    Process process(directory / "", name, programs + "/proofmass",
                    {"report", "grown.db", "--requirement", "k2c < 1e9 for 95% with 95%"});
    EXPECT_EQ(process.wait(), exit_code);
    return read_file(path(name + ".out"));
  };
  ASSERT_EQ(start("grown", {"--runs", "64"}).wait(), 0) << errors_of("grown");
  const std::string fixed = report("fixed", 0);
  EXPECT_TRUE(contains(fixed, "Answer       met\nRule         64 draws, a number fixed")) << fixed;
  ASSERT_EQ(start("grown", {"--runs", "72"}).wait(), 0) << errors_of("grown");
  const std::string extended = report("extended", 3);
  EXPECT_TRUE(contains(extended, "Answer       undecided\nRule         sequential")) << extended;
}

using FailureBudget = CampaignProcess;

// No instrument is as well aligned as this.
TEST_F(FailureBudget, EndsACampaignThatFails) {
  const Arguments hopeless{"--set", "acceptance.a_c1j_max_rad=1e-12", "--failures", "40"};
  EXPECT_EQ(start("failing", hopeless).wait(), 1);
  EXPECT_TRUE(contains(errors_of("failing"),
                       " of 320 runs given up or without an estimate (at most "
                       "40 with --failures); cancelled\n"))
      << errors_of("failing");
  const auto file = path("failing.db");
  EXPECT_EQ(stored_text(file, "SELECT phase FROM campaign"), "cancelled");
  EXPECT_EQ(stored_text(file, "SELECT count(*) > 40 AND count(*) < 320 FROM run_result"), "1");
  EXPECT_TRUE(contains(read_file(path("failing.out")), " without draw\n"));
}

}  // namespace
}  // namespace proofmass::test
