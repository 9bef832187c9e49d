#include "worker/execution/run_queue.hpp"

#include <gtest/gtest.h>

namespace proofmass::worker {
namespace {

using Leases = std::vector<wire::LeaseId>;

wire::RunLease lease(std::uint64_t id, std::uint64_t first, std::uint64_t count) {
  return {.lease = {id},
          .runs = {{first}, count},
          .attempt = {static_cast<std::uint32_t>(id + 1)},
          .table_values = {}};
}

TEST(RunQueue, HandsOutRunsAcrossLeasesInTheOrderInWhichTheyCame) {
  RunQueue queue;
  queue.add(lease(1, 10, 3));
  queue.add(lease(2, 40, 1));
  queue.add(lease(3, 5, 2));
  const std::vector<Assignment> assignments = queue.take(5);
  const std::vector<std::pair<std::uint64_t, std::uint64_t>> expected{
      {1, 10}, {1, 11}, {1, 12}, {2, 40}, {3, 5}};
  ASSERT_EQ(assignments.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(assignments[i].lease.value, expected[i].first);
    EXPECT_EQ(assignments[i].attempt.value, expected[i].first + 1);
    EXPECT_EQ(assignments[i].request.run.value, expected[i].second);
  }
  EXPECT_EQ(queue.leases(), Leases{{3}});
}

TEST(RunQueue, HandsOutWhatThereIs) {
  RunQueue queue;
  EXPECT_TRUE(queue.take(16).empty());
  queue.add(lease(1, 0, 3));
  EXPECT_EQ(queue.take(16).size(), 3U);
  EXPECT_TRUE(queue.empty());
}

TEST(RunQueue, HandsEachRunItsTableValues) {
  RunQueue queue;
  wire::RunLease two = lease(1, 0, 2);
  two.table_values = {1.5, -1.0, 2.5, -2.0};
  queue.add(two);
  queue.add(lease(2, 7, 1));
  const std::vector<Assignment> assignments = queue.take(3);
  EXPECT_EQ(assignments[0].request.table_values, (std::vector<double>{1.5, -1.0}));
  EXPECT_EQ(assignments[1].request.table_values, (std::vector<double>{2.5, -2.0}));
  EXPECT_EQ(assignments[2].request.table_values, std::vector<double>{});
}

TEST(RunQueue, ForgetsALeaseOfWhichARunWasTaken) {
  RunQueue queue;
  queue.add(lease(1, 0, 5));
  (void)queue.take(2);
  EXPECT_EQ(queue.leases(), Leases{{1}});
  queue.clear();
  EXPECT_TRUE(queue.empty());
  queue.add(lease(2, 20, 1));
  EXPECT_EQ(queue.take(1)[0].request.run, RunIndex{20});
}

}  // namespace
}  // namespace proofmass::worker
