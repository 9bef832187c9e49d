#include "worker/execution/executor.hpp"

#include <gtest/gtest.h>

#include <future>
#include <semaphore>
#include <stdexcept>

namespace proofmass::worker {
namespace {

std::shared_ptr<const Campaign> campaign() { return std::make_shared<const Campaign>(); }

wire::RunLease lease(std::uint64_t id, std::uint64_t first, std::uint64_t count) {
  return {.lease = {id}, .runs = {{first}, count}, .attempt = {3}, .table_values = {}};
}

/// A run that yields its index as its number of draws, after `num_orbits` orbits.
Prepare prepare_counting(int num_orbits) {
  return [num_orbits](const Campaign&) -> Simulate {
    return [num_orbits](RunIndex run, std::span<const double> values,
                        const std::function<void(int)>& progress) {
      for (int orbit = 1; orbit <= num_orbits; ++orbit) progress(orbit);
      RunResult result;
      result.run = run;
      result.num_draws = static_cast<std::uint32_t>(run.value);
      result.truth[0] = values.empty() ? 0.0 : values.front();
      return result;
    };
  };
}

/// An executor whose finished runs can be waited for.
class Bench {
 public:
  explicit Bench(Prepare prepare) : executor(std::move(prepare), [this] { changed_.release(); }) {}

  std::vector<FinishedRun> wait_for(std::size_t count) {
    std::vector<FinishedRun> all;
    while (all.size() < count) {
      changed_.acquire();
      for (FinishedRun& run : executor.take_finished()) all.push_back(std::move(run));
    }
    return all;
  }

  void wait_for_change() { changed_.acquire(); }

 private:
  std::counting_semaphore<> changed_{0};

 public:
  Executor executor;
};

TEST(Executor, ComputesTheRunsOfItsLeasesInOrder) {
  Bench bench(prepare_counting(2));
  bench.executor.start(campaign());
  bench.executor.submit(lease(7, 10, 3));
  bench.executor.submit(lease(8, 40, 1));
  const std::vector<FinishedRun> runs = bench.wait_for(4);
  const std::array<std::uint64_t, 4> expected{10, 11, 12, 40};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(runs[i].computed.result.run.value, expected[i]);
    EXPECT_EQ(runs[i].computed.result.num_draws, expected[i]);
    EXPECT_EQ(runs[i].lease.value, i < 3 ? 7U : 8U);
    EXPECT_EQ(runs[i].attempt.value, 3U);
    EXPECT_GE(runs[i].computed.compute_s, 0.0);
  }
  EXPECT_EQ(bench.executor.num_orbits_done(), 8U);
  EXPECT_TRUE(bench.executor.open_leases().empty());
}

TEST(Executor, HandsEachRunItsTableValues) {
  Bench bench(prepare_counting(1));
  bench.executor.start(campaign());
  wire::RunLease two = lease(1, 0, 2);
  two.table_values = {1.5, -1.0, 2.5, -2.0};
  bench.executor.submit(two);
  const std::vector<FinishedRun> runs = bench.wait_for(2);
  EXPECT_EQ(runs[0].computed.result.truth[0], 1.5);
  EXPECT_EQ(runs[1].computed.result.truth[0], 2.5);
}

/// A run that waits in its first orbit until it is let go.
struct Gate {
  std::binary_semaphore entered{0};
  std::binary_semaphore open{0};

  Prepare prepare() {
    return [this](const Campaign&) -> Simulate {
      return
          [this](RunIndex run, std::span<const double>, const std::function<void(int)>& progress) {
            entered.release();
            open.acquire();
            progress(1);
            RunResult result;
            result.run = run;
            return result;
          };
    };
  }
};

TEST(Executor, DropsTheRunAtHandWhenItAbandons) {
  Gate gate;
  Bench bench(gate.prepare());
  bench.executor.start(campaign());
  bench.executor.submit(lease(1, 0, 2));
  gate.entered.acquire();
  EXPECT_EQ(bench.executor.open_leases().size(), 2U);  // The run at hand, and the rest.
  bench.executor.abandon();
  gate.open.release();

  bench.executor.submit(lease(2, 5, 1));
  gate.entered.acquire();
  gate.open.release();
  const std::vector<FinishedRun> runs = bench.wait_for(1);
  ASSERT_EQ(runs.size(), 1U);
  EXPECT_EQ(runs[0].computed.result.run, RunIndex{5});
}

TEST(Executor, EndsInTheMiddleOfARun) {
  Gate gate;
  {
    Bench bench(gate.prepare());
    bench.executor.start(campaign());
    bench.executor.submit(lease(1, 0, 1000));
    gate.entered.acquire();
    gate.open.release();
  }
  SUCCEED();
}

TEST(Executor, PreparesANewCampaign) {
  int num_prepared = 0;
  Bench bench([&](const Campaign& of) {
    ++num_prepared;
    return prepare_counting(1)(of);
  });
  bench.executor.start(campaign());
  bench.executor.submit(lease(1, 0, 1));
  (void)bench.wait_for(1);
  bench.executor.start(campaign());
  bench.executor.submit(lease(2, 1, 1));
  EXPECT_EQ(bench.wait_for(1)[0].lease, wire::LeaseId{2});
  EXPECT_EQ(num_prepared, 2);
}

TEST(Executor, SaysWhyItCannotGoOn) {
  Bench bench([](const Campaign&) -> Simulate { throw std::runtime_error("out of memory"); });
  EXPECT_FALSE(bench.executor.failure().has_value());
  bench.executor.start(campaign());
  bench.wait_for_change();
  EXPECT_EQ(bench.executor.failure(), "out of memory");
}

}  // namespace
}  // namespace proofmass::worker
