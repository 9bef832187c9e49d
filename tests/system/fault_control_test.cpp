// Workers that have to end, campaigns that are paused or cancelled, and runs that crash or never
// end.

#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <string>

#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

class ControlledCampaign : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    write_null_campaign(1600);
  }
};

class WorkerEnd : public ControlledCampaign {
 protected:
  /// What a worker was lent and did not finish, but for what it was asked to give back.
  [[nodiscard]] std::string reasons_of_losses() const {
    return stored_text(file_of("null"),
                       "SELECT group_concat(DISTINCT reason) FROM attempt "
                       "WHERE reason <> 'retracted'");
  }
  [[nodiscard]] std::string end_of(const std::string& worker) const {
    return stored_text(file_of("null"),
                       "SELECT end_reason FROM worker WHERE worker = '" + worker + "'");
  }
};

// It stops early enough to finish and deliver what it computes, whose time it knows. The earlier of
// two ends counts.
TEST_F(WorkerEnd, ComesBeforeTheWalltime) {
  Process coordinator = this->coordinator("coordinator", {"null.toml", "--exit-when-done"});
  wait_for_log("coordinator", "coordinator_started");
  const auto walltime_end = std::chrono::steady_clock::now() + std::chrono::seconds(16);
  const std::int64_t end_time = std::time(nullptr) + 16;  // Not later, as it cuts off a fraction.
  Process limited = null_worker("limited", {"--max-walltime", "1h", "--end-time",
                                            std::to_string(end_time), "--run-time", "0.1"});
  EXPECT_EQ(limited.wait(), 0) << errors_of("limited");
  EXPECT_LT(std::chrono::steady_clock::now(), walltime_end);
  ASSERT_LT(num_done("null"), num_null_runs);
  wait_until("end in the file", [&] { return end_of("limited") == "walltime"; });
  EXPECT_EQ(
      stored_text(file_of("null"), "SELECT count(*) FROM delivery"),
      stored_text(file_of("null"), "SELECT num_results FROM worker WHERE worker = 'limited'"));
  Process other = null_worker("other");
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(other.wait(), 0) << errors_of("other");
  EXPECT_EQ(reasons_of_losses(), "walltime");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

TEST_F(WorkerEnd, BySigtermLosesNothing) {
  Process coordinator = this->coordinator("coordinator", {"null.toml", "--exit-when-done"});
  Process asked = null_worker("asked", {"--run-time", "0.1"});
  wait_for_done("null", 1);
  asked.signal(SIGTERM);
  EXPECT_EQ(asked.wait(), 0) << errors_of("asked");
  ASSERT_LT(num_done("null"), num_null_runs);
  Process other = null_worker("other");
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(other.wait(), 0) << errors_of("other");
  EXPECT_EQ(end_of("asked"), "preempted");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

using CampaignControl = ControlledCampaign;

// While it is paused, the worker computes another one.
TEST_F(CampaignControl, PausesAndResumes) {
  write_campaign("other", 500);
  const Process coordinator = this->coordinator("coordinator", {"null.toml"});
  const Process worker = null_worker("worker");
  wait_for_done("null", 1);
  (void)told({"pause", "null"});
  wait_until("last lent run", [&] { return status_of("null").at("num_lent") == 0; });
  EXPECT_EQ(status_of("null").at("phase"), "paused");
  (void)told({"submit", "other.toml"});
  wait_for_done("other", 1);  // What was delivered before has been stored by then.
  const std::size_t num_done_before = num_done("null");
  ASSERT_LT(num_done_before, num_null_runs);
  wait_for_done("other", 500);
  EXPECT_EQ(num_done("null"), num_done_before);
  (void)told({"resume", "null"});
  wait_for_done("null", num_null_runs);
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

TEST_F(CampaignControl, CancelsAndGoesOn) {
  const Process coordinator = this->coordinator("coordinator", {"null.toml"});
  const Process worker = null_worker("worker");
  wait_for_done("null", 1);
  Process watch =
      start_behind({}, "watch", "proofmass", {"watch", "null", "--connect", clients_endpoint});
  wait_until("watching", [&] { return read_file(path("watch.out")) != ""; });
  (void)told({"cancel", "null"});
  EXPECT_EQ(watch.wait(), 1);
  const nlohmann::json cancelled = status_of("null");
  EXPECT_EQ(cancelled.at("phase"), "cancelled");
  EXPECT_EQ(cancelled.at("num_lent"), 0);
  ASSERT_LT(cancelled.at("num_done"), num_null_runs);
  (void)told({"resume", "null"});
  wait_for_done("null", num_null_runs);
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

/// One run does harm to whoever computes it; two machines find out.
class HarmfulRun : public ControlledCampaign {
 protected:
  static constexpr std::int64_t harmful = 1234;

  /// A machine is a key: all workers of a test have one address.
  void make_keys_of_two_machines() const {
    for (const Arguments& further : {Arguments{}, Arguments{"--worker", "second"}}) {
      Arguments arguments{"keygen", "keys"};
      arguments.insert(arguments.end(), further.begin(), further.end());
      Process keygen = start_behind({}, "keygen", "proofmass", arguments);
      ASSERT_EQ(keygen.wait(), 0) << errors_of("keygen");
    }
    std::filesystem::create_directory(path("seconds"));
    std::filesystem::copy_file(path("keys/second.key"), path("seconds/worker.key"));
    std::filesystem::copy_file(path("keys/coordinator.pub"), path("seconds/coordinator.pub"));
  }

  /// The campaign ends without that run, and all others are what they should be.
  /// @param time_scale  Of the coordinator alone: that a worker crashed is told by the one that
  ///                    starts in its place after seconds, before its silence may count.
  void expect_all_others(const std::string& option, const std::string& time_scale) const {
    make_keys_of_two_machines();
    Process coordinator = this->coordinator(
        "coordinator",
        {"null.toml", "--exit-when-done", "--keys", "keys", "--time-scale", time_scale});
    const std::string run = std::to_string(harmful);
    const Process one = null_worker("one", {option, run, "--keys", "keys"});
    const Process two = null_worker("two", {option, run, "--keys", "seconds"});
    EXPECT_EQ(coordinator.wait(), 1) << errors_of("coordinator");
    EXPECT_EQ(num_log_lines("coordinator", "run_given_up run=" + run + " crashes="), 1U)
        << errors_of("coordinator");
    EXPECT_EQ(stored_text(file_of("null"), "SELECT group_concat(run_index) FROM run_failure"),
              std::to_string(harmful));
    (void)undisturbed_digest("null");
    auto runs = stored_runs(path("undisturbed/null.db"));
    runs.erase(harmful);
    EXPECT_EQ(stored_runs(file_of("null")), runs);
  }
};

TEST_F(HarmfulRun, ThatCrashesIsGivenUpAfterThreeCrashes) {
  expect_all_others("--poison", "1");
  EXPECT_TRUE(contains(errors_of("coordinator"), "reason=crashed"));
}

TEST_F(HarmfulRun, ThatHangsIsGivenUpAfterThreeWorkers) {
  expect_all_others("--hang", "0.05");
  EXPECT_TRUE(contains(errors_of("coordinator"), "reason=hung"));
}

}  // namespace
}  // namespace proofmass::test
