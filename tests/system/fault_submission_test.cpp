// Submissions that are large, with real processes.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <string>

#include "coordinator/net/client_connection.hpp"
#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

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

}  // namespace
}  // namespace proofmass::test
