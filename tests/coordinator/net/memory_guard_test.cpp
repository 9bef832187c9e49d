#include <sys/resource.h>
#include <unistd.h>

#include <condition_variable>
#include <cstring>

#include "coordinator/net/service_sockets.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t mebibyte = std::size_t{1} << 20;

TEST(MemoryBound, IsExceededFromThreeQuartersOn) {
  MemoryBound bound(400);
  EXPECT_FALSE(bound.is_exceeded(300));
  EXPECT_TRUE(bound.is_exceeded(301));
  EXPECT_FALSE(bound.note_reset(50));
  EXPECT_TRUE(bound.is_exceeded(301));
}

TEST(MemoryBound, WaitsForAQuarterMoreIfAResetDidNotHelp) {
  MemoryBound bound(400);
  EXPECT_TRUE(bound.is_exceeded(500));
  EXPECT_TRUE(bound.note_reset(480));
  EXPECT_EQ(bound.limit(), 600U);
  EXPECT_FALSE(bound.is_exceeded(600));
  EXPECT_TRUE(bound.is_exceeded(601));
  EXPECT_FALSE(bound.note_reset(601));  // Told once.
  EXPECT_FALSE(bound.is_exceeded(700));
}

TEST(MemoryBound, IsAsBeforeOnceMemoryIsLow) {
  MemoryBound bound(400);
  EXPECT_TRUE(bound.note_reset(480));
  EXPECT_FALSE(bound.is_exceeded(300));
  EXPECT_TRUE(bound.is_exceeded(301));
  EXPECT_TRUE(bound.note_reset(480));
}

TEST(ResidentMemory, GrowsWithWhatIsUsed) {
  const ResidentMemory memory;
  const std::size_t before = memory.size();
  const std::vector<char> used(64 * mebibyte, 'x');
  EXPECT_GE(memory.size(), before + 60 * mebibyte);
#ifndef __SANITIZE_THREAD__  // It keeps several bytes for each of ours.
  EXPECT_LE(memory.size(), before + 80 * mebibyte);
#endif
}

/// Sockets that hold so much of this process's memory.
class MemoryGuardTest : public testing::Test {
 protected:
#if defined(__SANITIZE_ADDRESS__)
  void SetUp() override { GTEST_SKIP() << "AddressSanitizer keeps what is freed"; }
#endif

  [[nodiscard]] MemoryGuard::Actions actions() {
    return {.close =
                [this] {
                  const std::lock_guard lock(mutex);
                  held.clear();
                  held.shrink_to_fit();
                },
            .open =
                [this] {
                  const std::lock_guard lock(mutex);
                  ++num_opened;
                  return num_opened > num_failures;
                },
            .lacks_descriptors = [this] { return lacks_descriptors.exchange(false); },
            .note =
                [this](const Event& event) {
                  const std::lock_guard lock(mutex);
                  events.emplace_back(event.kind);
                  changed.notify_all();
                }};
  }

  std::vector<std::string> wait_for_events(std::size_t count) {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, std::chrono::seconds(20), [&] { return events.size() >= count; });
    return events;
  }

  std::mutex mutex;
  std::condition_variable changed;
  std::vector<char> held;
  std::vector<std::string> events;
  std::atomic<bool> lacks_descriptors = false;
  int num_opened = 0;
  int num_failures = 0;
  std::size_t size_at_start = ResidentMemory().size();
};

TEST_F(MemoryGuardTest, TellsOnceOfWhatItCannotFree) {
  const std::vector<char> needed(100 * mebibyte, 'x');
  const MemoryGuard guard((size_at_start + 60 * mebibyte) / 3 * 4, actions());
  (void)wait_for_events(2);
  {
    const std::lock_guard lock(mutex);
    held.assign(100 * mebibyte, 'x');
  }
  EXPECT_EQ(wait_for_events(3),
            (std::vector<std::string>{"sockets_reset", "memory_high", "sockets_reset"}));
}

TEST_F(MemoryGuardTest, TriesAgainUntilAnAddressCanBeHad) {
  num_failures = 3;
  const MemoryGuard guard((size_at_start + 60 * mebibyte) / 3 * 4, actions());
  {
    const std::lock_guard lock(mutex);
    held.assign(100 * mebibyte, 'x');
  }
  EXPECT_EQ(wait_for_events(3),
            (std::vector<std::string>{"sockets_reset", "sockets_unbound", "sockets_bound"}));
  EXPECT_EQ(num_opened, 4);
}

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

TEST(Descriptors, AreKeptForWorkersByCampaigns) {
  EXPECT_TRUE(has_room_for_campaign(1024, 0, 1024 - 3 * 64 - 5));
  EXPECT_FALSE(has_room_for_campaign(1024, 0, 1024 - 3 * 64 - 4));
  EXPECT_TRUE(has_room_for_campaign(80, 16, 64 - 3 * 8 - 5));
  EXPECT_FALSE(has_room_for_campaign(80, 16, 64 - 3 * 8 - 4));
  EXPECT_FALSE(has_room_for_campaign(16, 20, 3));
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
