#include "worker/gpu/cuda_device.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <sstream>
#include <thread>
#include <utility>

#include "core/error.hpp"

namespace proofmass::worker {
namespace {

/// A function of the driver, for a pointer of its type.
struct Symbol {
  void* address;

  template <typename Function>
  operator Function*() const {
    return reinterpret_cast<Function*>(address);
  }
};

Symbol driver_symbol(const char* name) {
  static void* const library = dlopen("libcuda.so.1", RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    throw DeviceError("no NVIDIA driver: libcuda.so.1 cannot be loaded");
  }
  void* const symbol = dlsym(library, name);
  if (symbol == nullptr) {
    throw DeviceError(fmt::format("NVIDIA driver too old: libcuda.so.1 has no {}", name));
  }
  return {symbol};
}

// The part of the driver's interface that is used, by the names and types of its documentation.
// The version behind a name is the one that programs compiled today would be linked with. Addresses
// of a card's memory, numbers there, are pointers here.
struct CudaFunctions {
#define PROOFMASS_CUDA(name, ...) int (*name)(__VA_ARGS__) = driver_symbol(#name)
  PROOFMASS_CUDA(cuInit, unsigned);
  PROOFMASS_CUDA(cuDriverGetVersion, int*);
  PROOFMASS_CUDA(cuGetErrorName, int, const char**);
  PROOFMASS_CUDA(cuDeviceGetCount, int*);
  PROOFMASS_CUDA(cuDeviceGet, int*, int);
  PROOFMASS_CUDA(cuDeviceGetName, char*, int, int);
  PROOFMASS_CUDA(cuDeviceGetAttribute, int*, int, int);
  PROOFMASS_CUDA(cuDevicePrimaryCtxRetain, void**, int);
  PROOFMASS_CUDA(cuCtxSetCurrent, void*);
  PROOFMASS_CUDA(cuModuleLoadData, void**, const void*);
  PROOFMASS_CUDA(cuModuleGetFunction, void**, void*, const char*);
  PROOFMASS_CUDA(cuFuncSetAttribute, void*, int, int);
  PROOFMASS_CUDA(cuOccupancyMaxActiveBlocksPerMultiprocessor, int*, void*, int, std::size_t);
  PROOFMASS_CUDA(cuMemGetInfo_v2, std::size_t*, std::size_t*);
  PROOFMASS_CUDA(cuMemAlloc_v2, void**, std::size_t);
  PROOFMASS_CUDA(cuMemFree_v2, void*);
  PROOFMASS_CUDA(cuMemcpyHtoDAsync_v2, void*, const void*, std::size_t, void*);
  PROOFMASS_CUDA(cuMemcpyDtoHAsync_v2, void*, const void*, std::size_t, void*);
  PROOFMASS_CUDA(cuStreamCreateWithPriority, void**, unsigned, int);
  PROOFMASS_CUDA(cuStreamSynchronize, void*);
  PROOFMASS_CUDA(cuStreamWaitEvent, void*, void*, unsigned);
  PROOFMASS_CUDA(cuEventCreate, void**, unsigned);
  PROOFMASS_CUDA(cuEventRecord, void*, void*);
  PROOFMASS_CUDA(cuEventQuery, void*);
  PROOFMASS_CUDA(cuLaunchKernel, void*, unsigned, unsigned, unsigned, unsigned, unsigned, unsigned,
                 unsigned, void*, void**, void**);
#undef PROOFMASS_CUDA
};

// Of the driver's enumerations.
constexpr int not_ready = 600;
constexpr int num_processors_attribute = 16;
constexpr int shared_bytes_attribute = 8;  // Of a function: dynamic shared memory at most.
constexpr unsigned non_blocking_stream = 1;
constexpr int first_priority = -1;  // Smaller numbers come first; the driver knows some six.
constexpr unsigned event_without_times = 2;

/// How often a kernel that runs is looked after. As the next one waits behind it, the card idles
/// for none of this time.
constexpr std::chrono::milliseconds poll_interval(1);

/// @throws DeviceError if there is no driver, or if it lacks one of its functions.
const CudaFunctions& cuda() {
  static const CudaFunctions functions;
  return functions;
}

void check_call(int result, const std::string& what) {
  if (result == 0) return;
  const char* name = nullptr;
  if (cuda().cuGetErrorName(result, &name) != 0 || name == nullptr) name = "unknown error";
  throw DeviceError(fmt::format("{}: {} ({})", what, name, result));
}

/// Those of this machine.
/// @throws DeviceError if there is no driver or no card, saying which.
std::vector<CudaCard> cuda_cards() {
  check_call(cuda().cuInit(0), "NVIDIA driver");
  int version = 0;
  check_call(cuda().cuDriverGetVersion(&version), "version of the NVIDIA driver");
  int num_cards = 0;
  check_call(cuda().cuDeviceGetCount(&num_cards), "number of NVIDIA cards");
  if (num_cards == 0) throw DeviceError("no NVIDIA card on this machine");
  std::vector<CudaCard> cards;
  for (int i = 0; i < num_cards; ++i) {
    int device = 0;
    std::array<char, 256> name{};
    check_call(cuda().cuDeviceGet(&device, i), fmt::format("card {}", i));
    check_call(cuda().cuDeviceGetName(name.data(), static_cast<int>(name.size()) - 1, device),
               fmt::format("name of card {}", i));
    cards.push_back(
        {.index = i,
         .name = fmt::format("{} (CUDA {}.{})", name.data(), version / 1000, version % 1000 / 10)});
  }
  return cards;
}

}  // namespace

std::vector<CudaCard> cuda_cards_of(std::string_view text) {
  if (text == "none") return {};
  const auto refusal_text = [text](const std::string& reason) {
    return fmt::format("gpu = {} ({})", text, reason);
  };
  if (text != "all" && (text.empty() || text.find_first_not_of("0123456789,") != text.npos)) {
    throw InvalidArgument(refusal_text("must be none, all, or numbers of cards as in 0,1"));
  }
  std::vector<CudaCard> others;
  try {
    others = cuda_cards();
  } catch (const DeviceError& error) {
    throw DeviceError(refusal_text(error.what()));
  }
  if (text == "all") return others;
  const std::size_t num_cards = others.size();
  std::vector<CudaCard> chosen;
  std::istringstream numbers(std::string(text) + ",");
  for (std::string number; std::getline(numbers, number, ',');) {
    const auto card = std::ranges::find(
        others, number, [](const CudaCard& other) { return std::to_string(other.index); });
    if (card == others.end()) {
      throw InvalidArgument(refusal_text(
          fmt::format("must be different numbers below {}, of the cards here", num_cards)));
    }
    chosen.push_back(std::move(*card));
    others.erase(card);
  }
  return chosen;
}

CudaDevice::CudaDevice(const CudaCard& card, std::chrono::milliseconds time_max)
    : index_(card.index), time_max_(time_max) {
  check(cuda().cuDeviceGet(&device_, index_), "not found");
  check(cuda().cuDevicePrimaryCtxRetain(&context_, device_), "cannot be opened");
  check(cuda().cuCtxSetCurrent(context_), "context");
  const auto make_stream = [&](Handle& stream, int priority) {
    check(cuda().cuStreamCreateWithPriority(&stream, non_blocking_stream, priority), "stream");
  };
  make_stream(copies_, 0);
  make_stream(queues_[0], 0);
  make_stream(queues_[1], first_priority);
  for (Handle& mark : marks_) check(cuda().cuEventCreate(&mark, event_without_times), "event");
}

void CudaDevice::check(int result, const char* what) const {
  if (result != 0) check_call(result, fmt::format("card {}: {}", index_, what));
}

void CudaDevice::begin(const char* program) {
  check(cuda().cuCtxSetCurrent(context_), "context");
  for (Mark mark = 0; mark < num_marks; ++mark) wait(mark);
  for (void* const address : std::exchange(memory_, {})) {
    check(cuda().cuMemFree_v2(address), "memory");
  }
  if (module_ != nullptr) return;
  check(cuda().cuModuleLoadData(&module_, program), "driver cannot compile the kernels");
}

CudaDevice::Handle CudaDevice::kernel(const char* name) const {
  Handle function = nullptr;
  check(cuda().cuModuleGetFunction(&function, module_, name), name);
  return function;
}

std::size_t CudaDevice::num_resident_blocks(const char* name, std::size_t num_threads,
                                            std::size_t shared_bytes) {
  Handle function = kernel(name);
  check(cuda().cuFuncSetAttribute(function, shared_bytes_attribute, static_cast<int>(shared_bytes)),
        "shared memory");
  int num_processors = 0;
  int num_blocks = 0;
  check(cuda().cuDeviceGetAttribute(&num_processors, num_processors_attribute, device_),
        "processors");
  check(cuda().cuOccupancyMaxActiveBlocksPerMultiprocessor(
            &num_blocks, function, static_cast<int>(num_threads), shared_bytes),
        "occupancy");
  if (num_blocks == 0) throw DeviceError(fmt::format("card {}: too small", index_));
  return static_cast<std::size_t>(num_processors) * static_cast<std::size_t>(num_blocks);
}

std::size_t CudaDevice::free_bytes() {
  std::size_t num_free = 0;
  std::size_t num_total = 0;
  check(cuda().cuMemGetInfo_v2(&num_free, &num_total), "memory");
  return num_free;
}

void* CudaDevice::allocate(std::size_t num_bytes) {
  void* address = nullptr;
  check(cuda().cuMemAlloc_v2(&address, num_bytes),
        fmt::format("{} bytes of memory", num_bytes).c_str());
  return memory_.emplace_back(address);
}

void CudaDevice::copy_in(void* to, std::span<const std::byte> from) {
  check(cuda().cuMemcpyHtoDAsync_v2(to, from.data(), from.size(), copies_), "copy to it");
  check(cuda().cuStreamSynchronize(copies_), "copy to it");
}

void CudaDevice::copy_out(std::span<std::byte> to, const void* from) {
  check(cuda().cuMemcpyDtoHAsync_v2(to.data(), from, to.size(), copies_), "copy from it");
  check(cuda().cuStreamSynchronize(copies_), "copy from it");
}

void CudaDevice::launch(Queue queue, const Launch& launch) {
  Handle stream = queues_[static_cast<std::size_t>(queue)];
  const auto size = [](std::size_t n) { return static_cast<unsigned>(n); };
  check(cuda().cuStreamWaitEvent(stream, marks_[launch.after], 0), "event");
  check(cuda().cuLaunchKernel(kernel(launch.kernel), size(launch.num_blocks),
                              size(launch.num_blocks_y), 1, size(launch.num_threads), 1, 1,
                              size(launch.shared_bytes), stream,
                              const_cast<void**>(launch.arguments.data()), nullptr),
        "launch");
  check(cuda().cuEventRecord(marks_[launch.mark], stream), "event");
}

void CudaDevice::wait(Mark mark) {
  // Counting how often it waited, and not the time, is what exempts a process that was stopped.
  for (std::chrono::milliseconds waited{0};; waited += poll_interval) {
    const int result = cuda().cuEventQuery(marks_[mark]);
    if (result != not_ready) return check(result, "kernels");
    if (waited >= time_max_) {
      throw DeviceError(fmt::format(
          "card {}: a kernel has not ended within {} s (the card hangs: reset it, as by nvidia-smi "
          "--gpu-reset, or leave it out of --gpu)",
          index_, std::chrono::duration_cast<std::chrono::seconds>(time_max_).count()));
    }
    std::this_thread::sleep_for(poll_interval);
  }
}

}  // namespace proofmass::worker
