// The results of a campaign do not depend on who computes it.

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>

#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

class WorkerCount : public FaultTest {
 protected:
  using Start = Process (WorkerCount::*)(const std::string&, const Arguments&,
                                         const Arguments&) const;

  /// The digest of the campaign in a file, computed by so many processes that were all there before
  /// the first run was lent.
  [[nodiscard]] std::string digest_with(int count, Start start, const std::string& file,
                                        const std::string& campaign) {
    served = "served-" + std::to_string(count);
    const Process coordinator = this->coordinator(served, {});
    Processes workers;
    for (int i = 0; i < count; ++i) {
      const std::string name = served + "-" + std::to_string(i);
      workers.emplace_back(new Process((this->*start)(name, {"--no-supervisor"}, {})));
    }
    wait_until("workers", [&] {
      return num_log_lines(served, "worker_registered") == static_cast<std::size_t>(count);
    });
    (void)told({"submit", file});
    wait_for_log(served, "campaign_finished");
    const std::string query = "SELECT count(*) FROM worker WHERE num_results > 0";
    EXPECT_GT(std::stoi(stored_text(file_of(campaign), query)), count / 2);
    return digest(campaign);
  }
};

TEST_F(WorkerCount, DoesNotChangeTheDigestOfNullRuns) {
  write_null_campaign(2000);
  const std::string expected = undisturbed_digest("null");
  for (const int count : {1, 2, 7, 32}) {
    EXPECT_EQ(digest_with(count, &WorkerCount::null_worker, "null.toml", "null"), expected)
        << count;
  }
}

TEST_F(WorkerCount, DoesNotChangeTheDigestOfSimulatedRuns) {
  const std::string expected = undisturbed_digest("hardy2013");
  for (const int count : {1, 2, 7, 32}) {
    EXPECT_EQ(digest_with(count, &WorkerCount::worker, "short.toml", "hardy2013"), expected)
        << count;
  }
}

}  // namespace
}  // namespace proofmass::test
