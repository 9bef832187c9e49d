// The results of a campaign do not depend on who computes it.

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

/// A campaign and the program that computes it.
struct Work {
  std::string campaign;
  std::string file;
  std::string program;
  Arguments further;
};

class WorkerCount : public FaultTest {
 protected:
  /// Of the campaign, computed by so many processes that were all there before a run was lent.
  [[nodiscard]] std::string digest_with(std::size_t count, const Work& work) {
    served = "served-" + std::to_string(count);
    const Process coordinator = this->coordinator(served, {});
    Processes workers;
    for (std::size_t i = 0; i < count; ++i) {
      Arguments arguments{"--connect", workers_endpoint, "--threads", "1", "--no-supervisor"};
      arguments.insert(arguments.end(), work.further.begin(), work.further.end());
      const std::string name = served + "-" + std::to_string(i);
      workers.emplace_back(new Process(start_behind({}, name, work.program, arguments)));
    }
    wait_until("workers", [&] { return num_log_lines(served, "worker_registered") == count; });
    (void)told({"submit", work.file});
    wait_for_log(served, "campaign_finished");
    const std::string query = "SELECT count(*) FROM worker WHERE num_results > 0";
    EXPECT_GT(std::stoul(stored_text(file_of(work.campaign), query)), count / 2);
    return digest(work.campaign);
  }

  void expect_one_digest(const Work& work) {
    const std::string expected = undisturbed_digest(work.campaign);
    for (const std::size_t count : {1U, 2U, 7U, 32U}) {
      EXPECT_EQ(digest_with(count, work), expected) << count << " workers";
    }
  }
};

TEST_F(WorkerCount, DoesNotChangeTheDigestOfNullRuns) {
  write_null_campaign(2000);
  expect_one_digest({.campaign = "null",
                     .file = "null.toml",
                     .program = "proofmass-null-worker",
                     .further = {"--run-time", "0.02"}});
}

TEST_F(WorkerCount, DoesNotChangeTheDigestOfSimulatedRuns) {
  expect_one_digest({.campaign = "hardy2013",
                     .file = "short.toml",
                     .program = "proofmass-worker",
                     .further = {}});
}

}  // namespace
}  // namespace proofmass::test
