// Processes that are killed or stopped at any time.

#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <string>

#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

class RandomFaults : public FaultTest, public testing::WithParamInterface<unsigned> {
 protected:
  RandomFaults() : draw_(GetParam()) {}

  [[nodiscard]] std::size_t draw(std::size_t count) { return draw_() % count; }

  /// Lets the campaign go on for a while, as long as nothing but the seed tells, or to its end.
  void go_on() {
    using std::chrono::steady_clock;
    wait_for_done("null", std::min(num_done("null") + 1 + draw(300), num_null_runs));
    const auto end = steady_clock::now() + std::chrono::milliseconds(draw(40));
    wait_until("later", [&] { return steady_clock::now() >= end; });
  }

  /// Without --exit-when-done it is there to be killed however late that comes.
  [[nodiscard]] Process null_coordinator(int number, const Arguments& further = {}) const {
    Arguments arguments{"null.toml"};
    arguments.insert(arguments.end(), further.begin(), further.end());
    return coordinator("coordinator-" + std::to_string(number), arguments);
  }

  [[nodiscard]] std::unique_ptr<Process> next_worker() {
    return std::unique_ptr<Process>(
        new Process(null_worker("worker-" + std::to_string(num_workers_++), {"--no-supervisor"})));
  }

 private:
  std::mt19937 draw_;
  int num_workers_ = 0;
};

TEST_P(RandomFaults, KillEverything) {
  constexpr int num_kills = 4;
  Processes workers;
  for (int i = 0; i < 3; ++i) workers.push_back(next_worker());
  for (int i = 0; i < num_kills; ++i) {
    Process coordinator = null_coordinator(i, {"--time-scale", "0.05"});
    go_on();
    const std::size_t victim = draw(workers.size());
    workers[victim]->signal(SIGKILL);
    workers[victim] = next_worker();
    go_on();
    coordinator.signal(SIGKILL);
    ASSERT_EQ(coordinator.wait(), -SIGKILL) << errors_of("coordinator-" + std::to_string(i));
  }
  Process coordinator = null_coordinator(num_kills, {"--time-scale", "0.05", "--exit-when-done"});
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator-" + std::to_string(num_kills));
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

INSTANTIATE_TEST_SUITE_P(Seed, RandomFaults, testing::Values(1U, 2U, 3U),
                         [](const auto& seed) { return std::to_string(seed.param); });

using StoppedWorker = FaultTest;

// Another computes what it was computing. When it goes on it may be told so before it is done:
// late results are those of a worker that is cut off, see FaultyNetwork.
TEST_F(StoppedWorker, HoldsUpNothing) {
  Process coordinator = this->coordinator("coordinator", {"null.toml", "--time-scale", "0.02"});
  Process slow = null_worker("slow", {"--no-supervisor", "--run-time", "0.5"});
  wait_for_log("coordinator", "name=slow");
  const Process quick = null_worker("quick");
  wait_until("runs at both workers", [&] {
    return stored_text(file_of("null"), "SELECT count(*) FROM worker WHERE num_results > 0") == "2";
  });
  slow.signal(SIGSTOP);
  wait_for_log("coordinator", "name=slow reason=silent");
  // Lost runs go first, so these are all of them and some more.
  wait_for_done("null", std::min(num_done("null") + 300, num_null_runs));
  slow.signal(SIGCONT);
  end_when_done(coordinator, "coordinator", 3);
  EXPECT_EQ(slow.wait(), 0) << errors_of("slow");
  EXPECT_EQ(stored_text(file_of("null"), "SELECT count(*) FROM audit WHERE NOT is_equal"), "0");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

// As batch systems suspend programs. It does not take its own silence for the coordinator's.
TEST_F(StoppedWorker, GoesOnAfterLongerThanItWouldWaitForItsCoordinator) {
  using std::chrono::steady_clock;
  Process coordinator = this->coordinator("coordinator", {"null.toml", "--exit-when-done"});
  Process worker = null_worker("worker", {"--no-supervisor", "--give-up-after", "4"});
  wait_for_done("null", 100);
  worker.signal(SIGSTOP);
  const auto end = steady_clock::now() + std::chrono::seconds(5);
  wait_until("later", [&] { return steady_clock::now() >= end; });
  worker.signal(SIGCONT);
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(worker.wait(), 0) << errors_of("worker");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

using StoppedCoordinator = FaultTest;

// Its own silence is not the workers': what they said meanwhile counts.
TEST_F(StoppedCoordinator, TakesNoWorkerForLost) {
  using std::chrono::steady_clock;
  Process coordinator =
      this->coordinator("coordinator", {"null.toml", "--exit-when-done", "--time-scale", "0.02"});
  Process one = null_worker("one");
  Process two = null_worker("two");
  wait_for_done("null", 100);
  coordinator.signal(SIGSTOP);
  const auto end = steady_clock::now() + std::chrono::seconds(2);  // They are lost after 1.2 s.
  wait_until("later", [&] { return steady_clock::now() >= end; });
  coordinator.signal(SIGCONT);
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(one.wait(), 0) << errors_of("one");
  EXPECT_EQ(two.wait(), 0) << errors_of("two");
  EXPECT_EQ(num_log_lines("coordinator", "reason=silent"), 0U) << errors_of("coordinator");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

}  // namespace
}  // namespace proofmass::test
