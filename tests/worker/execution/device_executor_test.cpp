// How an executor serves a device, with devices that compute nothing.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <deque>
#include <memory>
#include <semaphore>
#include <set>
#include <span>
#include <vector>

#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/support/cuda_driver/test_device.hpp"
#include "tests/support/messages.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/prepared_campaign.hpp"
#include "worker/execution/executor.hpp"

namespace proofmass::worker {
namespace {

using testing::HasSubstr;

constexpr wire::CampaignId campaign{1};

std::vector<RunResult> results_of(std::span<const RunRequest> requests, double truth = 1.0) {
  std::vector<RunResult> results;
  for (const RunRequest& request : requests) {
    results.push_back(test::zero_result({.run = request.run}));
    results.back().truth[0] = truth;
  }
  return results;
}

/// What the devices of a test did, and are to do.
struct Script {
  double truth = 1.0;            ///< Of the results; a processor finds 1.
  std::size_t fails_after = 99;  ///< Groups.
  bool can_simulate = true;
  std::atomic<std::size_t> num_runs = 0;
  std::atomic<std::size_t> num_in_flight_max = 0;
};

/// Ends a group with each call, the first first.
class ScriptedSimulation final : public DeviceSimulation {
 public:
  explicit ScriptedSimulation(Script& script) : script_(script) {}

  [[nodiscard]] std::size_t capacity() const override { return 400; }
  [[nodiscard]] std::size_t num_in_flight() const override { return num_in_flight_; }
  void add(std::uint64_t group, std::span<const RunRequest> requests) override {
    EXPECT_LE(requests.size(), group_size);
    groups_.push_back({group, results_of(requests, script_.truth)});
    num_in_flight_ += requests.size();
    script_.num_in_flight_max = std::max(script_.num_in_flight_max.load(), num_in_flight_);
  }
  [[nodiscard]] int num_steps_done(std::uint64_t) const override { return 1; }
  [[nodiscard]] std::vector<Ended> advance() override {
    if (num_ended_++ == script_.fails_after) throw DeviceError("card 0: burnt");
    std::vector<Ended> ended{groups_.front()};
    groups_.pop_front();
    num_in_flight_ -= ended.front().results.size();
    script_.num_runs += ended.front().results.size();
    script_.num_runs.notify_all();
    return ended;
  }

 private:
  Script& script_;
  std::deque<Ended> groups_;
  std::size_t num_in_flight_ = 0;
  std::size_t num_ended_ = 0;
};

std::function<std::unique_ptr<DeviceSimulation>(Device&)> simulate_on(Script& script) {
  return [&script](Device&) { return std::make_unique<ScriptedSimulation>(script); };
}

/// An executor with one thread and one device.
class DeviceBench {
 public:
  explicit DeviceBench(Script& script, double checked_fraction = 0.0)
      : executor(
            [&script](const Campaign&) -> test::PreparedCampaign {
              return {.simulate =
                          [](std::span<const RunRequest> requests,
                             const std::function<void(int)>& progress) {
                            progress(2);
                            return results_of(requests);
                          },
                      .num_steps = 2,
                      .simulate_on = script.can_simulate ? simulate_on(script) : nullptr};
            },
            [this] { changed_.release(); },
            {.num_threads = 1,
             .batch_size_max = 1,
             .devices = {std::make_shared<CudaDevice>(card())},
             .checked_fraction = checked_fraction}) {}

  void submit(std::uint64_t num_runs, bool is_for_cards = true) {
    proto::RunLease lease = test::make_lease(campaign, {{0}, num_runs}, {3});
    lease.set_is_for_cards(is_for_cards);
    executor.submit(lease, std::array{wire::runs_of(lease)});
    // The first run prepares the campaign; by then all of them wait.
    executor.define(campaign, std::make_shared<const MicroscopeCampaign>());
  }

  std::multiset<std::uint64_t> wait_for(std::size_t count) {
    std::multiset<std::uint64_t> runs;
    while (runs.size() < count) {
      changed_.acquire();
      for (const wire::LeasedResult& run : executor.take_finished()) {
        runs.insert(run.computed.result.run.value);
      }
    }
    return runs;
  }

  std::string wait_for_failure() {
    while (!executor.failure()) changed_.acquire();
    return *executor.failure();
  }

 private:
  static CudaCard card() {
    test::load_driver();
    return cuda_cards_of("all").front();
  }

  std::counting_semaphore<> changed_{0};

 public:
  Executor executor;
};

// Those that a processor computes again are neither delivered nor counted again.
TEST(DeviceExecutor, ComputesEachRunOnceSomewhere) {
  Script script;
  DeviceBench bench(script, 0.1);
  constexpr std::size_t num_runs = 4000;
  bench.submit(num_runs);
  const std::multiset<std::uint64_t> runs = bench.wait_for(num_runs);
  EXPECT_EQ(std::set<std::uint64_t>(runs.begin(), runs.end()).size(), num_runs);
  EXPECT_EQ(script.num_runs, num_runs);
  EXPECT_LE(script.num_in_flight_max, 400U);
  EXPECT_TRUE(bench.executor.computing().empty());
  EXPECT_EQ(bench.executor.num_steps_done(), 2 * num_runs);
}

TEST(DeviceExecutor, LeavesRunsThatAreNotForCardsToProcessors) {
  Script script;
  DeviceBench bench(script);
  bench.submit(300, false);
  EXPECT_EQ(bench.wait_for(300).size(), 300U);
  EXPECT_EQ(script.num_runs, 0U);
}

TEST(DeviceExecutor, LeavesACampaignThatDevicesCannotComputeToProcessors) {
  Script script{.can_simulate = false};
  DeviceBench bench(script);
  bench.submit(300);
  EXPECT_EQ(bench.wait_for(300).size(), 300U);
  EXPECT_EQ(script.num_runs, 0U);
}

TEST(DeviceExecutor, EndsIfADeviceFails) {
  Script script{.fails_after = 2};
  DeviceBench bench(script);
  bench.submit(4000);
  EXPECT_EQ(bench.wait_for_failure(), "card 0: burnt");
}

TEST(DeviceExecutor, EndsIfADeviceDiffersFromTheProcessor) {
  Script script{.truth = 1.0 + 1e-15};
  DeviceBench bench(script, 0.2);
  bench.submit(4000);
  EXPECT_THAT(bench.wait_for_failure(), HasSubstr("differs between device and processor"));
}

TEST(DeviceExecutor, DropsWhatADeviceComputes) {
  Script script;
  DeviceBench bench(script);
  bench.submit(4000);
  (void)bench.wait_for(100);
  EXPECT_TRUE(bench.executor.end_within(std::chrono::seconds(60)));
}

}  // namespace
}  // namespace proofmass::worker
