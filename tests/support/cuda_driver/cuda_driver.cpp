// Stands in for NVIDIA's driver: libcuda.so.1 with the functions that a worker calls, which runs
// the kernels as they are compiled for the host, at once and on the calling thread. The variable
// PROOFMASS_TEST_CUDA names what is wrong with it: no_card, two_cards, no_memory, broken_launch,
// lost_device, hang, or late_hang: the first kernels that have as many runs as fit, which no proof
// has, never end. Preloaded into a program, it lets no time pass while that waits.

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <set>
#include <string_view>
#include <vector>

#include "core/microscope/simulation/gpu/sample_kernels-inl.hpp"

namespace proofmass::gpu {
namespace {

enum class Kernel : std::uintptr_t { none, noise, loop };

// A card with four processors of one block each, and memory for launches of some samples.
constexpr int num_processors = 4;
constexpr std::size_t memory_bytes = std::size_t{1} << 27;

void run_block(Kernel kernel, const Shared& shared, const SessionTable* sessions,
               const GroupMemory& memory, const Portion* portions, std::size_t x, std::size_t y) {
  const Portion& portion = portions[x];
  constexpr std::size_t words = num_words<LoopConstants<double>> * group_lanes;
  std::vector<std::uint64_t> constants(memory.constants + portion.slot * words,
                                       memory.constants + (portion.slot + 1) * words);
  Stage stage;
  for (std::size_t lane = 0; lane < portion.num_lanes; ++lane) {
    if (kernel == Kernel::noise) {
      make_noise(shared, sessions, memory, portion, x, y, lane);
    } else {
      advance_lane_of({.shared = shared,
                       .session = sessions[portion.session],
                       .memory = memory,
                       .portion = portion,
                       .position = x,
                       .constants = constants.data(),
                       .stage = &stage,
                       .threads = {}},
                      lane);
    }
  }
}

}  // namespace
}  // namespace proofmass::gpu

using proofmass::gpu::Kernel;

namespace {

constexpr int failed = 999;
constexpr int not_ready = 600;
int num_launches = 0;
bool is_hung = false;

/// As a driver's memory it is lost to nobody while the process lives.
std::set<void*>& memory() {
  static auto* const all = new std::set<void*>;
  return *all;
}

bool is_asked_for(std::string_view fault) {
  const char* const asked = std::getenv("PROOFMASS_TEST_CUDA");
  return asked != nullptr && asked == fault;
}

}  // namespace

extern "C" {
int cuInit(unsigned) { return 0; }
int cuDriverGetVersion(int* version) {
  *version = 12040;
  return 0;
}
int cuGetErrorName(int, const char** name) {
  *name = "CUDA_ERROR_OF_THE_TEST";
  return 0;
}
int cuDeviceGetCount(int* count) {
  *count = is_asked_for("no_card") ? 0 : (is_asked_for("two_cards") ? 2 : 1);
  return 0;
}
int cuDeviceGet(int* device, int index) {
  *device = index;
  return 0;
}
int cuDeviceGetName(char* name, int length, int) {
  std::snprintf(name, static_cast<std::size_t>(length), "a card of the tests");
  return 0;
}
int cuDeviceGetAttribute(int* value, int, int) {
  *value = proofmass::gpu::num_processors;
  return 0;
}
int cuDevicePrimaryCtxRetain(void**, int) { return 0; }
int cuCtxSetCurrent(void*) { return 0; }
int cuModuleLoadData(void** module, const void* program) {
  *module = const_cast<void*>(program);
  return 0;
}
int cuModuleGetFunction(void** function, void*, const char* name) {
  const bool is_noise = std::string_view(name) == "proofmass_noise";
  *function = reinterpret_cast<void*>(is_noise ? Kernel::noise : Kernel::loop);
  return 0;
}
int cuFuncSetAttribute(void*, int, int) { return 0; }
int cuOccupancyMaxActiveBlocksPerMultiprocessor(int* num_blocks, void*, int, std::size_t) {
  *num_blocks = 1;
  return 0;
}
int cuMemGetInfo_v2(std::size_t* num_free, std::size_t* num_total) {
  *num_free = *num_total = proofmass::gpu::memory_bytes;
  return 0;
}
int cuMemAlloc_v2(void** address, std::size_t size) {
  if (is_asked_for("no_memory")) return failed;
  *address = *memory().insert(std::aligned_alloc(64, (size + 63) / 64 * 64)).first;
  std::memset(*address, 0xff, size);  // What is read before it is written shows.
  return 0;
}
int cuMemFree_v2(void* address) {
  memory().erase(address);
  std::free(address);
  return 0;
}
int cuMemcpyHtoDAsync_v2(void* to, const void* from, std::size_t size, void*) {
  std::memcpy(to, from, size);
  return 0;
}
int cuMemcpyDtoHAsync_v2(void* to, const void* from, std::size_t size, void*) {
  std::memcpy(to, from, size);
  return 0;
}
int cuStreamCreateWithPriority(void**, unsigned, int) { return 0; }
int cuStreamSynchronize(void*) { return 0; }
int cuStreamWaitEvent(void*, void*, unsigned) { return 0; }
int cuEventCreate(void**, unsigned) { return 0; }
int cuEventRecord(void*, void*) { return 0; }
int cuEventQuery(void*) {
  if (is_asked_for("lost_device") && num_launches > 4) return failed;
  is_hung = is_hung && (is_asked_for("hang") || is_asked_for("late_hang"));
  return is_hung ? not_ready : 0;
}
int cuLaunchKernel(void* function, unsigned num_blocks, unsigned num_blocks_y, unsigned, unsigned,
                   unsigned, unsigned, unsigned, void*, void** arguments, void**) {
  using namespace proofmass::gpu;
  if (is_asked_for("broken_launch")) return failed;
  ++num_launches;
  const auto& shared = *static_cast<const Shared*>(arguments[0]);
  const auto* const sessions = *static_cast<const SessionTable* const*>(arguments[1]);
  const auto& memory = *static_cast<const GroupMemory*>(arguments[2]);
  const auto* const portions = *static_cast<const Portion* const*>(arguments[3]);
  is_hung = is_asked_for("hang") ||
            (is_asked_for("late_hang") && (is_hung || portions[0].num_lanes == group_lanes));
  if (is_hung) return 0;
  for (std::size_t x = 0; x < num_blocks; ++x) {
    for (std::size_t y = 0; y < num_blocks_y; ++y) {
      run_block(static_cast<Kernel>(reinterpret_cast<std::uintptr_t>(function)), shared, sessions,
                memory, portions, x, y);
    }
  }
  return 0;
}

int nanosleep(const timespec*, timespec*) { return 0; }
}
