// Submissions that are large, and clients that may not do what they ask for, with real processes.

#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>

#include "coordinator/net/client_connection.hpp"
#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

namespace fs = std::filesystem;

class LargeSubmission : public FaultTest {
 protected:
  /// A campaign with the values of two quantities for each of so many runs.
  void write_large_campaign(std::size_t count) const {
    std::ofstream(path("large.toml"))
        << "[campaign]\nname = \"large\"\nruns = " << count
        << "\n[dispersion.offcentring_m]\n"
           "x = { law = \"table\", file = \"draws.csv\", column = \"x\" }\n"
           "z = { law = \"table\", file = \"draws.csv\", column = \"z\" }\n";
    std::ofstream draws(path("draws.csv"));
    draws << "x,z\n";
    for (std::size_t i = 0; i < count; ++i) {
      draws << "1." << i % 1000 << "e-5,2." << i % 997 << "e-5\n";
    }
  }
};

// Meanwhile clients are answered, workers too, and what they deliver is stored. When the service's
// thread read the submission, neither happened until it was done.
TEST_F(LargeSubmission, HoldsUpNobody) {
  using Clock = std::chrono::steady_clock;
  constexpr std::size_t num_rows = 3'200'000;  // 51 MB.
  write_null_campaign(1'000'000);
  write_large_campaign(num_rows);
  const Process coordinator = this->coordinator("coordinator", {"null.toml"});
  const Process worker = null_worker("worker");
  wait_for_done("null", 1);
  coordinator::ClientConnection client({.endpoint = clients_endpoint,
                                        .keys = {},
                                        .is_plain_waived = false,
                                        .reply_wait = std::chrono::seconds(60)});
  const Clock::time_point began_at = Clock::now();
  Process submit = start_behind({}, "submit", "proofmass",
                                {"submit", "large.toml", "--connect", clients_endpoint});
  Clock::duration longest_answer{};
  Clock::duration longest_without_results{};
  Clock::time_point result_at = Clock::now();
  std::uint64_t num_done_before = 0;
  proto::RequestEnvelope status_request;
  status_request.mutable_status();
  while (!submit.has_ended()) {
    const Clock::time_point asked_at = Clock::now();
    const std::uint64_t num_done = client.ask(status_request).status().campaigns(0).num_done();
    const Clock::time_point now = Clock::now();
    longest_answer = std::max(longest_answer, now - asked_at);
    if (num_done > num_done_before) result_at = now;
    num_done_before = num_done;
    longest_without_results = std::max(longest_without_results, now - result_at);
  }
  const Clock::duration whole = Clock::now() - began_at;
  EXPECT_EQ(submit.wait(), 0) << errors_of("submit");
  const auto seconds = [](Clock::duration duration) {
    return std::to_string(std::chrono::duration<double>(duration).count());
  };
  RecordProperty("longest_answer_s", seconds(longest_answer));
  RecordProperty("longest_without_results_s", seconds(longest_without_results));
  RecordProperty("whole_s", seconds(whole));
  EXPECT_LT(longest_answer, whole / 4) << seconds(whole);
  EXPECT_LT(longest_without_results, whole / 4) << seconds(whole);
  EXPECT_EQ(num_log_lines("coordinator", "worker_lost"), 0U);
  EXPECT_EQ(status_of("large").at("num_runs"), num_rows);
}

/// Clients with keys of their own.
class ClientRights : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    write_null_campaign(500);
    workers_endpoint = "tcp://127.0.0.1:*";
    clients_endpoint = "tcp://127.0.0.1:*";
    keygen({"keys"});
    for (const std::string name : {"anna", "ben", "guest"}) {
      keygen({"keys", "--client", name});
      fs::create_directory(path(name));
      fs::permissions(path(name), fs::perms::owner_all);
      fs::copy_file(path("keys") / (name + ".key"), path(name) / "client.key");
      fs::copy_file(path("keys") / "coordinator.pub", path(name) / "coordinator.pub");
    }
    const std::string list = read_file(path("keys/authorized_clients"));
    std::ofstream(path("keys/authorized_clients"))
        << std::regex_replace(list, std::regex(" guest\n"), " guest observe\n");
  }

  void keygen(Arguments arguments) const {
    arguments.insert(arguments.begin(), "keygen");
    Process process = start_behind({}, "keygen", "proofmass", arguments);
    ASSERT_EQ(process.wait(), 0) << errors_of("keygen");
  }

  /// Starts a coordinator at ports that it finds.
  [[nodiscard]] std::unique_ptr<Process> start_coordinator(Arguments further = {}) {
    further.insert(further.end(), {"--keys", "keys"});
    std::unique_ptr<Process> process(new Process(coordinator("coordinator", further)));
    wait_for_log("coordinator", "coordinator_started");
    std::smatch found;
    const std::string log = errors_of("coordinator");
    EXPECT_TRUE(std::regex_search(log, found, std::regex("bind=(\\S+) bind_clients=(\\S+)")));
    clients_endpoint = found[2];
    return process;
  }

  /// What a client is told: its output, or its error if it is refused.
  [[nodiscard]] std::string told_to(const std::string& name, const Arguments& command) const {
    Arguments arguments = command;
    arguments.insert(arguments.end(), {"--connect", clients_endpoint, "--keys", name});
    Process client = start_behind({}, "client", "proofmass", arguments);
    return client.wait() == 0 ? read_file(path("client.out")) : errors_of("client");
  }
};

TEST_F(ClientRights, ReachToTheirOwnCampaigns) {
  const auto process = start_coordinator();
  EXPECT_TRUE(contains(told_to("guest", {"submit", "null.toml"}),
                       "error: key = guest (must have the right `submit`"));
  EXPECT_TRUE(contains(told_to("anna", {"submit", "null.toml"}), "campaign null: active"));
  EXPECT_TRUE(contains(told_to("guest", {"status", "--json"}), "\"owner\": \"anna\""));
  const std::string refused =
      "error: campaign = null (belongs to anna; the key ben must have the right `control`)\n";
  EXPECT_TRUE(contains(told_to("ben", {"cancel", "null"}), refused));
  EXPECT_TRUE(contains(told_to("ben", {"submit", "null.toml", "--runs", "600"}), refused));
  EXPECT_TRUE(contains(told_to("guest", {"pause", "null"}), "error: key = guest (must have"));
  EXPECT_TRUE(contains(told_to("anna", {"pause", "null"}), "campaign null: paused"));
  EXPECT_TRUE(contains(told_to("anna", {"release", "n7"}), "error: key = anna (must have"));
  // The first client's key, of whoever set the coordinator up.
  EXPECT_TRUE(contains(told_to("keys", {"cancel", "null"}), "campaign null: cancelled"));
  EXPECT_TRUE(contains(told_to("keys", {"release", "n7"}), "host = n7 (is not in quarantine)"));
}

TEST_F(ClientRights, OutliveTheCoordinator) {
  {
    const auto process = start_coordinator();
    EXPECT_TRUE(contains(told_to("anna", {"submit", "null.toml"}), "campaign null: active"));
    process->signal(SIGTERM);
    EXPECT_EQ(process->wait(), 0) << errors_of("coordinator");
  }
  const auto process = start_coordinator();
  EXPECT_TRUE(contains(told_to("ben", {"cancel", "null"}), "belongs to anna"));
  EXPECT_TRUE(contains(told_to("anna", {"cancel", "null"}), "campaign null: cancelled"));
}

TEST_F(ClientRights, AreBoundedInNumberAndSize) {
  const auto process = start_coordinator({"--campaigns-per-key", "2"});
  for (const std::string name : {"one", "two", "three"}) write_campaign(name, 16);
  EXPECT_TRUE(contains(told_to("anna", {"submit", "one.toml"}), "campaign one: active"));
  EXPECT_TRUE(contains(told_to("anna", {"submit", "two.toml"}), "campaign two: active"));
  EXPECT_TRUE(contains(told_to("anna", {"submit", "three.toml"}),
                       "error: campaigns = 3 (must be at most 2 unfinished ones of the key anna)"));
  EXPECT_TRUE(contains(told_to("ben", {"submit", "three.toml"}), "campaign three: active"));
  EXPECT_TRUE(contains(told_to("anna", {"cancel", "one"}), "campaign one: cancelled"));
  EXPECT_TRUE(contains(told_to("anna", {"submit", "null.toml"}), "campaign null: active"));
}

TEST_F(ClientRights, AreBoundedInTheSizeOfDefinitions) {
  const auto process = start_coordinator({"--bytes-per-key", "25000"});
  for (const std::string name : {"one", "two", "three"}) write_campaign(name, 16);
  EXPECT_TRUE(contains(told_to("anna", {"submit", "one.toml"}), "campaign one: active"));
  EXPECT_TRUE(contains(told_to("anna", {"submit", "two.toml"}), "campaign two: active"));
  EXPECT_TRUE(contains(told_to("anna", {"submit", "three.toml"}), "(must be at most 25000 of"));
}

// Whoever can reach the socket of a coordinator without keys may do everything.
TEST_F(LargeSubmission, IsLimitedByKeysAlone) {
  const Process coordinator = this->coordinator("coordinator", {"--campaigns-per-key", "1"});
  for (const std::string name : {"one", "two"}) {
    write_campaign(name, 16);
    EXPECT_TRUE(contains(told({"submit", name + ".toml"}), "campaign " + name + ": active"));
  }
  EXPECT_TRUE(contains(told({"cancel", "one"}), "campaign one: cancelled"));
}

}  // namespace
}  // namespace proofmass::test
