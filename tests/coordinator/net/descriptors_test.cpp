#include "coordinator/net/descriptors.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdint>

namespace proofmass::coordinator {
namespace {

TEST(DescriptorLimit, BecomesWhatTheSystemAllows) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  ASSERT_GT(before.rlim_max, 256U);
  const rlimit low{.rlim_cur = 256, .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &low), 0);

  EXPECT_EQ(raise_descriptor_limit(), before.rlim_max);

  rlimit after{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &after), 0);
  EXPECT_EQ(after.rlim_cur, before.rlim_max);
  setrlimit(RLIMIT_NOFILE, &before);
}

TEST(Descriptors, AreKeptForFilesAndClients) {
  const Descriptors large = shared_out(4096, 0, 20);
  EXPECT_EQ(large.num_workers_max, 4096U - 128U - 20U);
  EXPECT_EQ(large.alarm, 4096 - 64);
  const Descriptors small = shared_out(80, 16, 20);
  EXPECT_EQ(small.num_workers_max, 28U);
  EXPECT_EQ(small.alarm, 56);
  EXPECT_EQ(shared_out(16, 0, 20).num_workers_max, 0U);
  EXPECT_EQ(shared_out(16, 20, 20).num_workers_max, 0U);
  EXPECT_GT(shared_out(~std::uint64_t{0}, 0, 20).num_workers_max, 1'000'000'000U);
}

TEST(Descriptors, AreCountedByTheLowestThatIsFree) {
  const int before = lowest_free_descriptor();
  const int taken = dup(0);
  EXPECT_EQ(taken, before);
  EXPECT_GT(lowest_free_descriptor(), before);
  close(taken);
  EXPECT_EQ(lowest_free_descriptor(), before);
}

}  // namespace
}  // namespace proofmass::coordinator
