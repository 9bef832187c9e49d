#include "worker/execution/executor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <semaphore>
#include <stdexcept>

namespace proofmass::worker {
namespace {

using Leases = std::vector<wire::LeaseId>;
using Indices = std::vector<std::uint64_t>;

std::shared_ptr<const Campaign> campaign() { return std::make_shared<const Campaign>(); }

wire::RunLease lease(std::uint64_t id, std::uint64_t first, std::uint64_t count) {
  return {.lease = {id}, .runs = {{first}, count}, .attempt = {3}, .table_values = {}};
}

/// Runs that yield their index as number of draws, the size of their batch as number of rounds and
/// their first table value as truth.
std::vector<RunResult> results_of(std::span<const RunRequest> requests) {
  std::vector<RunResult> results;
  for (const RunRequest& request : requests) {
    RunResult result;
    result.run = request.run;
    result.num_draws = static_cast<std::uint32_t>(request.run.value);
    result.num_rounds = static_cast<std::uint32_t>(requests.size());
    result.truth[0] = request.table_values.empty() ? 0.0 : request.table_values.front();
    results.push_back(result);
  }
  return results;
}

/// Such runs, after `num_orbits` orbits, of each of which they report twice.
Prepare prepare_counting(int num_orbits) {
  return [num_orbits](const Campaign&) -> Simulate {
    return [num_orbits](std::span<const RunRequest> requests,
                        const std::function<void(int)>& progress) {
      for (int half = 1; half <= 2 * num_orbits; ++half) progress(half / 2);
      return results_of(requests);
    };
  };
}

/// An executor whose finished runs can be waited for.
class Bench {
 public:
  explicit Bench(Prepare prepare, const ExecutorConfig& config = {})
      : executor(
            std::move(prepare), [this] { changed_.release(); }, config) {}

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

Indices indices_of(const std::vector<FinishedRun>& runs) {
  Indices indices;
  for (const FinishedRun& run : runs) indices.push_back(run.computed.result.run.value);
  return indices;
}

TEST(Executor, ComputesTheRunsOfItsLeasesInOrder) {
  Bench bench(prepare_counting(2));
  bench.executor.start(campaign());
  bench.executor.submit(lease(7, 10, 3));
  bench.executor.submit(lease(8, 40, 1));
  const std::vector<FinishedRun> runs = bench.wait_for(4);
  EXPECT_EQ(indices_of(runs), (Indices{10, 11, 12, 40}));
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(runs[i].computed.result.num_draws, runs[i].computed.result.run.value);
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

/// Batches that wait in their first orbit until they are let go.
struct Gate {
  std::counting_semaphore<> entered{0};
  std::counting_semaphore<> open{0};

  Prepare prepare() {
    return [this](const Campaign&) -> Simulate {
      return
          [this](std::span<const RunRequest> requests, const std::function<void(int)>& progress) {
            entered.release();
            open.acquire();
            progress(1);
            return results_of(requests);
          };
    };
  }
};

// The first batch holds the thread while the leases come.
TEST(Executor, FillsABatchWithRunsOfSeveralLeases) {
  Gate gate;
  Bench bench(gate.prepare(), {.num_threads = 1, .batch_size_max = 4});
  bench.executor.start(campaign());
  bench.executor.submit(lease(1, 0, 1));
  gate.entered.acquire();
  bench.executor.submit(lease(2, 10, 3));
  bench.executor.submit(lease(3, 20, 3));
  gate.open.release(3);
  const std::vector<FinishedRun> runs = bench.wait_for(7);
  EXPECT_EQ(indices_of(runs), (Indices{0, 10, 11, 12, 20, 21, 22}));
  const Indices lease_of_each{1, 2, 2, 2, 3, 3, 3};
  const Indices size_of_its_batch{1, 4, 4, 4, 4, 2, 2};
  for (std::size_t i = 0; i < runs.size(); ++i) {
    EXPECT_EQ(runs[i].lease.value, lease_of_each[i]);
    EXPECT_EQ(runs[i].computed.result.num_rounds, size_of_its_batch[i]);
  }
  EXPECT_EQ(bench.executor.num_orbits_done(), 7U);
}

TEST(Executor, GivesEachRunTheTimeOfItsBatch) {
  Bench bench(prepare_counting(1), {.num_threads = 1, .batch_size_max = 4});
  bench.executor.start(campaign());
  bench.executor.submit(lease(1, 0, 4));
  const std::vector<FinishedRun> runs = bench.wait_for(4);
  for (const FinishedRun& run : runs) {
    EXPECT_EQ(run.computed.compute_s, runs[0].computed.compute_s);
  }
}

// Both threads are inside a batch at the same time, or the second entry never comes.
TEST(Executor, ComputesABatchOnEachThread) {
  Gate gate;
  std::atomic<int> num_prepared = 0;
  const auto prepare = [&](const Campaign& of) {
    ++num_prepared;
    return gate.prepare()(of);
  };
  Bench bench(prepare, {.num_threads = 2, .batch_size_max = 2});
  bench.executor.start(campaign());
  bench.executor.submit(lease(1, 0, 3));
  bench.executor.submit(lease(2, 3, 2));
  gate.entered.acquire();
  gate.entered.acquire();
  EXPECT_EQ(bench.executor.open_leases(), (Leases{{1}, {2}}));
  gate.open.release(3);
  Indices indices = indices_of(bench.wait_for(5));
  std::sort(indices.begin(), indices.end());
  EXPECT_EQ(indices, (Indices{0, 1, 2, 3, 4}));
  EXPECT_EQ(num_prepared, 1) << "once for both threads";
}

// Until its results are taken, nobody else speaks for a lease.
TEST(Executor, ListsALeaseUntilItsLastRunHasBeenTaken) {
  Gate gate;
  Bench bench(gate.prepare(), {.num_threads = 1, .batch_size_max = 4});
  bench.executor.start(campaign());
  bench.executor.submit(lease(1, 0, 6));
  bench.executor.submit(lease(2, 6, 1));
  gate.entered.acquire();
  EXPECT_EQ(bench.executor.open_leases(), (Leases{{1}, {2}}));
  gate.open.release();
  gate.entered.acquire();
  EXPECT_EQ(bench.executor.take_finished().size(), 4U);
  EXPECT_EQ(bench.executor.open_leases(), (Leases{{1}, {2}}));
  gate.open.release();
  bench.wait_for_change();
  bench.wait_for_change();
  EXPECT_EQ(bench.executor.open_leases(), (Leases{{1}, {2}}));
  EXPECT_EQ(bench.executor.take_finished().size(), 3U);
  EXPECT_EQ(bench.executor.open_leases(), Leases{});
}

TEST(Executor, DropsTheRunsAtHandWhenItAbandons) {
  Gate gate;
  Bench bench(gate.prepare(), {.num_threads = 2, .batch_size_max = 2});
  bench.executor.start(campaign());
  bench.executor.submit(lease(1, 0, 5));
  gate.entered.acquire();
  gate.entered.acquire();
  bench.executor.abandon();
  gate.open.release(2);

  bench.executor.submit(lease(2, 5, 1));
  gate.entered.acquire();
  gate.open.release();
  EXPECT_EQ(indices_of(bench.wait_for(1)), Indices{5});
}

TEST(Executor, EndsInTheMiddleOfRuns) {
  std::counting_semaphore<> entered{0};
  const auto prepare_endless = [&](const Campaign&) -> Simulate {
    return [&](std::span<const RunRequest>,
               const std::function<void(int)>& progress) -> std::vector<RunResult> {
      entered.release();
      while (true) progress(1);
    };
  };
  {
    Bench bench(prepare_endless, {.num_threads = 2, .batch_size_max = 3});
    bench.executor.start(campaign());
    bench.executor.submit(lease(1, 0, 1000));
    entered.acquire();
    entered.acquire();
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

// What was prepared for the first is never used.
TEST(Executor, PreparesACampaignThatStartsWhileAnotherIsPrepared) {
  std::binary_semaphore is_preparing{0};
  std::binary_semaphore go_on{0};
  std::atomic<int> num_prepared = 0;
  const auto prepare = [&](const Campaign&) -> Simulate {
    const int number = ++num_prepared;
    if (number == 1) {
      is_preparing.release();
      go_on.acquire();
    }
    return [number](std::span<const RunRequest> requests, const std::function<void(int)>&) {
      std::vector<RunResult> results = results_of(requests);
      for (RunResult& result : results) result.num_draws = static_cast<std::uint32_t>(number);
      return results;
    };
  };
  Bench bench(prepare, {.num_threads = 2, .batch_size_max = 2});
  bench.executor.start(campaign());
  is_preparing.acquire();
  bench.executor.start(campaign());
  bench.executor.submit(lease(1, 0, 2));
  go_on.release();
  for (const FinishedRun& run : bench.wait_for(2)) EXPECT_EQ(run.computed.result.num_draws, 2U);
}

TEST(Executor, SaysWhyItCannotGoOn) {
  Bench bench([](const Campaign&) -> Simulate { throw std::runtime_error("out of memory"); },
              {.num_threads = 3, .batch_size_max = 1});
  EXPECT_FALSE(bench.executor.failure().has_value());
  bench.executor.start(campaign());
  bench.wait_for_change();
  EXPECT_EQ(bench.executor.failure(), "out of memory");
}

}  // namespace
}  // namespace proofmass::worker
