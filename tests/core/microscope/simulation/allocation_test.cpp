// The sample loop allocates nothing: three times the orbits cost not one allocation more.

#include <gtest/gtest.h>

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>
#include <string>
#include <vector>

#include "core/microscope/simulation/run.hpp"

namespace {

std::atomic<std::size_t> num_allocations = 0;

void* counted(void* memory) {
  ++num_allocations;
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

// All of the program's allocations pass through here; the array forms call these. Inlined alone, a
// delete would look to GCC as if free() got what another function had allocated.
void* operator new(std::size_t size) { return counted(std::malloc(size)); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  const auto align = static_cast<std::size_t>(alignment);
  return counted(std::aligned_alloc(align, (size + align - 1) / align * align));
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t /*size*/) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::align_val_t /*alignment*/) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t /*size*/, std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}

namespace proofmass {
namespace {

/// Allocations while a batch of runs is recorded in sessions of so many orbits; the estimates take
/// as many more as they take rounds.
std::size_t allocations_of(int num_orbits, InstructionSet set) {
  MicroscopeCampaign campaign;
  campaign.scenario.simulation.sample_period_s = 1.0;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = num_orbits;
  const RunPlan plan(campaign);
  std::vector<RunRequest> requests;
  for (std::uint64_t run = 0; run < batch_lanes; ++run) requests.push_back({RunIndex{run}, {}});
  const std::size_t before = num_allocations;
  if (set == InstructionSet::scalar) {
    (void)plan.record(requests.front().run, {});
  } else {
    (void)plan.record_batch(requests, set);
  }
  return num_allocations - before;
}

TEST(Allocations, AreCounted) {
  const std::size_t before = num_allocations;
  const std::vector<int> numbers(1000);
  EXPECT_EQ(num_allocations - before, 1U) << numbers.size();
}

TEST(Allocations, DoNotGrowWithTheOrbits) {
  // Tables of names are made at their first use.
  (void)allocations_of(1, InstructionSet::scalar);
  for (const InstructionSet set : {InstructionSet::scalar, best_instruction_set()}) {
    const std::size_t of_one = allocations_of(1, set);
    EXPECT_GT(of_one, 0U);
    EXPECT_EQ(allocations_of(3, set), of_one) << name_of(set);
  }
}

}  // namespace
}  // namespace proofmass
