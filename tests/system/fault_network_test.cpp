// Coordinator and workers with keys on machines of their own, whose lines lose packets. It takes
// root: without it the tests are skipped, but fail in CI.

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>

#include "tests/skip_for_want.hpp"
#include "tests/system/fault_fixture.hpp"
#include "tests/system/network_namespace.hpp"

namespace proofmass::test {
namespace {

class FaultyNetwork : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    workers_endpoint = std::string("tcp://") + StarNetwork::hub_address + ":5555";
    clients_endpoint = "ipc://" + path("clients").string();
    Process keygen = start_behind({}, "keygen", "proofmass", {"keygen", "keys"});
    ASSERT_EQ(keygen.wait(), 0) << errors_of("keygen");
    try {
      network.emplace(directory / "");
      network->add("one");
      network->add("two");
    } catch (const std::runtime_error& error) {
      skip_for_want(std::string("no network namespaces: ") + error.what());
    }
  }

  [[nodiscard]] Process coordinator_at_hub(const Arguments& further = {}) const {
    Arguments arguments{"null.toml", "--keys", "keys"};
    arguments.insert(arguments.end(), further.begin(), further.end());
    return coordinator("coordinator", arguments, StarNetwork::at("hub"));
  }

  [[nodiscard]] Process worker_at(const std::string& machine, const std::string& run_time_s) const {
    return null_worker(machine, {"--keys", "keys", "--run-time", run_time_s},
                       StarNetwork::at(machine));
  }

  [[nodiscard]] bool both_have_delivered() const {
    return stored_text(file_of("null"), "SELECT count(*) FROM worker WHERE num_results > 0") == "2";
  }
  void wait_for_both() const {
    wait_until("results of both", [&] { return both_have_delivered(); });
  }

  std::optional<StarNetwork> network;
};

// A handshake may take as long as the other worker takes for all runs: the campaign is extended
// until both lines have carried results and lost packets.
TEST_F(FaultyNetwork, LosesAFifthOfThePacketsAndNoRun) {
  for (const char* const machine : {"one", "two"}) network->lose(machine, 0.2);
  Process coordinator = coordinator_at_hub();
  const Process one = worker_at("one", "0.02");
  const Process two = worker_at("two", "0.02");
  wait_for_done("null", num_null_runs);
  while (!both_have_delivered() || network->num_lost("one") <= 10 ||
         network->num_lost("two") <= 10) {
    extend_null_campaign(num_null_runs + 1000, {"--keys", "keys"});
    wait_for_done("null", num_null_runs);
  }
  end_when_done(coordinator, "coordinator", 2);
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

TEST_F(FaultyNetwork, CutsAWorkerOffForLongerThanItIsWaitedFor) {
  Process coordinator = coordinator_at_hub({"--time-scale", "0.05"});
  Process one = worker_at("one", "0.05");
  Process two = worker_at("two", "0.05");
  wait_for_both();
  network->lose("one", 1.0);
  wait_for_log("coordinator", "name=one reason=silent");
  // Lost runs go first, so these are all of them and some more. It has computed them meanwhile, and
  // what it delivers late is compared.
  wait_for_done("null", std::min(num_done("null") + 300, num_null_runs));
  network->mend("one");
  wait_until("late results", [&] {
    return stored_text(file_of("null"), "SELECT count(*) FROM audit WHERE is_equal") != "0";
  });
  end_when_done(coordinator, "coordinator", 3);
  EXPECT_EQ(stored_text(file_of("null"), "SELECT count(*) FROM audit WHERE NOT is_equal"), "0");
  EXPECT_EQ(one.wait(), 0) << errors_of("one");
  EXPECT_EQ(two.wait(), 0) << errors_of("two");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

TEST_F(FaultyNetwork, CutsEverybodyOff) {
  Process coordinator = coordinator_at_hub({"--time-scale", "0.05"});
  Process one = worker_at("one", "0.05");
  Process two = worker_at("two", "0.05");
  wait_for_both();
  for (const char* const machine : {"one", "two"}) network->lose(machine, 1.0);
  for (const char* const machine : {"one", "two"}) {
    wait_for_log("coordinator", std::string("name=") + machine + " reason=silent");
  }
  ASSERT_LT(num_done("null"), num_null_runs);
  for (const char* const machine : {"one", "two"}) network->mend(machine);
  end_when_done(coordinator, "coordinator", 4);
  EXPECT_EQ(one.wait(), 0) << errors_of("one");
  EXPECT_EQ(two.wait(), 0) << errors_of("two");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

// The worker notices after 20 s that nobody answers and connects anew, which is before it is taken
// for lost: it is the same worker as before.
TEST_F(FaultyNetwork, ChangesTheAddressOfAWorker) {
  Process coordinator = coordinator_at_hub();
  Process one = worker_at("one", "0.15");
  Process two = worker_at("two", "0.15");
  wait_for_both();
  network->change_address("one");
  wait_until("new address", [&] { return num_log_lines("one", "] connected") == 2; });
  end_when_done(coordinator, "coordinator", 2);
  EXPECT_EQ(one.wait(), 0) << errors_of("one");
  EXPECT_EQ(two.wait(), 0) << errors_of("two");
  EXPECT_EQ(num_log_lines("one", "] connected"), 2U) << errors_of("one");
  EXPECT_EQ(num_log_lines("coordinator", "worker_registered"), 2U) << errors_of("coordinator");
  EXPECT_EQ(num_log_lines("coordinator", "worker_gone"), 0U) << errors_of("coordinator");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

}  // namespace
}  // namespace proofmass::test
