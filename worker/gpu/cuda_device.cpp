#include "worker/gpu/cuda_device.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>

#include "core/error.hpp"

namespace proofmass::worker {

// The part of the driver's interface that is used, by the names and types of its documentation.
// The version behind a name is the one that programs compiled today would be linked with.
struct CudaFunctions {
  int (*cuInit)(unsigned);
  int (*cuDriverGetVersion)(int*);
  int (*cuGetErrorName)(int, const char**);
  int (*cuDeviceGetCount)(int*);
  int (*cuDeviceGet)(int*, int);
  int (*cuDeviceGetName)(char*, int, int);
  int (*cuDeviceGetAttribute)(int*, int, int);
  int (*cuDevicePrimaryCtxRetain)(void**, int);
  int (*cuDevicePrimaryCtxRelease_v2)(int);
  int (*cuCtxSetCurrent)(void*);
  int (*cuModuleLoadData)(void**, const void*);
  int (*cuModuleUnload)(void*);
  int (*cuModuleGetFunction)(void**, void*, const char*);
  int (*cuFuncSetAttribute)(void*, int, int);
  int (*cuOccupancyMaxActiveBlocksPerMultiprocessor)(int*, void*, int, std::size_t);
  int (*cuMemGetInfo_v2)(std::size_t*, std::size_t*);
  int (*cuMemAlloc_v2)(std::uint64_t*, std::size_t);
  int (*cuMemFree_v2)(std::uint64_t);
  int (*cuMemcpyHtoDAsync_v2)(std::uint64_t, const void*, std::size_t, void*);
  int (*cuMemcpyDtoHAsync_v2)(void*, std::uint64_t, std::size_t, void*);
  int (*cuStreamCreateWithPriority)(void**, unsigned, int);
  int (*cuStreamDestroy_v2)(void*);
  int (*cuStreamSynchronize)(void*);
  int (*cuStreamWaitEvent)(void*, void*, unsigned);
  int (*cuEventCreate)(void**, unsigned);
  int (*cuEventDestroy_v2)(void*);
  int (*cuEventRecord)(void*, void*);
  int (*cuEventSynchronize)(void*);
  int (*cuLaunchKernel)(void*, unsigned, unsigned, unsigned, unsigned, unsigned, unsigned, unsigned,
                        void*, void**, void**);
};

namespace {

// Of the driver's enumerations.
constexpr int num_processors_attribute = 16;
constexpr int shared_bytes_attribute = 8;  // Of a function: dynamic shared memory at most.
constexpr unsigned non_blocking_stream = 1;
constexpr int first_priority = -1;  // Smaller numbers come first; the driver knows some six.
constexpr unsigned blocking_event_without_times = 1 | 2;

CudaFunctions load_driver() {
  void* const library = dlopen("libcuda.so.1", RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    throw DeviceError("no NVIDIA driver: libcuda.so.1 cannot be loaded");
  }
  CudaFunctions cuda{};
  const auto find = [&](auto& function, const char* name) {
    void* const symbol = dlsym(library, name);
    if (symbol == nullptr) {
      throw DeviceError(fmt::format("NVIDIA driver too old: libcuda.so.1 has no {}", name));
    }
    function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(symbol);
  };
#define PROOFMASS_FIND(name) find(cuda.name, #name)
  PROOFMASS_FIND(cuInit);
  PROOFMASS_FIND(cuDriverGetVersion);
  PROOFMASS_FIND(cuGetErrorName);
  PROOFMASS_FIND(cuDeviceGetCount);
  PROOFMASS_FIND(cuDeviceGet);
  PROOFMASS_FIND(cuDeviceGetName);
  PROOFMASS_FIND(cuDeviceGetAttribute);
  PROOFMASS_FIND(cuDevicePrimaryCtxRetain);
  PROOFMASS_FIND(cuDevicePrimaryCtxRelease_v2);
  PROOFMASS_FIND(cuCtxSetCurrent);
  PROOFMASS_FIND(cuModuleLoadData);
  PROOFMASS_FIND(cuModuleUnload);
  PROOFMASS_FIND(cuModuleGetFunction);
  PROOFMASS_FIND(cuFuncSetAttribute);
  PROOFMASS_FIND(cuOccupancyMaxActiveBlocksPerMultiprocessor);
  PROOFMASS_FIND(cuMemGetInfo_v2);
  PROOFMASS_FIND(cuMemAlloc_v2);
  PROOFMASS_FIND(cuMemFree_v2);
  PROOFMASS_FIND(cuMemcpyHtoDAsync_v2);
  PROOFMASS_FIND(cuMemcpyDtoHAsync_v2);
  PROOFMASS_FIND(cuStreamCreateWithPriority);
  PROOFMASS_FIND(cuStreamDestroy_v2);
  PROOFMASS_FIND(cuStreamSynchronize);
  PROOFMASS_FIND(cuStreamWaitEvent);
  PROOFMASS_FIND(cuEventCreate);
  PROOFMASS_FIND(cuEventDestroy_v2);
  PROOFMASS_FIND(cuEventRecord);
  PROOFMASS_FIND(cuEventSynchronize);
  PROOFMASS_FIND(cuLaunchKernel);
#undef PROOFMASS_FIND
  return cuda;
}

const CudaFunctions& cuda_functions() {
  static const CudaFunctions functions = load_driver();
  return functions;
}

void check_call(const CudaFunctions& cuda, int result, const std::string& what) {
  if (result == 0) return;
  const char* name = nullptr;
  if (cuda.cuGetErrorName(result, &name) != 0 || name == nullptr) name = "unknown error";
  throw DeviceError(fmt::format("{}: {} ({})", what, name, result));
}

/// Those of this machine.
/// @throws DeviceError if there is no driver or no card, saying which.
std::vector<CudaCard> cuda_cards() {
  const CudaFunctions& cuda = cuda_functions();
  check_call(cuda, cuda.cuInit(0), "NVIDIA driver");
  int version = 0;
  check_call(cuda, cuda.cuDriverGetVersion(&version), "version of the NVIDIA driver");
  int num_cards = 0;
  check_call(cuda, cuda.cuDeviceGetCount(&num_cards), "number of NVIDIA cards");
  if (num_cards == 0) throw DeviceError("no NVIDIA card on this machine");
  std::vector<CudaCard> cards;
  for (int i = 0; i < num_cards; ++i) {
    int device = 0;
    std::array<char, 256> name{};
    check_call(cuda, cuda.cuDeviceGet(&device, i), fmt::format("card {}", i));
    check_call(cuda, cuda.cuDeviceGetName(name.data(), static_cast<int>(name.size()) - 1, device),
               fmt::format("name of card {}", i));
    cards.push_back({.index = i,
                     .name = name.data(),
                     .driver = fmt::format("{}.{}", version / 1000, version % 1000 / 10)});
  }
  return cards;
}

}  // namespace

std::vector<CudaCard> cuda_cards_of(std::string_view text) {
  if (text == "none") return {};
  const auto refusal = [text](const std::string& reason) {
    return InvalidArgument(fmt::format("gpu = {} ({})", text, reason));
  };
  constexpr std::string_view digits = "0123456789,";
  if (text != "all" && (text.empty() || text.find_first_not_of(digits) != text.npos)) {
    throw refusal("must be none, all, or numbers of cards as in 0,1");
  }
  std::vector<CudaCard> all;
  try {
    all = cuda_cards();
  } catch (const DeviceError& error) {
    throw refusal(error.what());
  }
  if (text == "all") return all;
  std::vector<CudaCard> chosen;
  for (std::string_view rest = text; chosen.empty() || !rest.empty();) {
    if (!chosen.empty()) rest.remove_prefix(1);  // A comma.
    std::size_t number = all.size();
    const char* const begin = rest.data();
    const char* const end = std::from_chars(begin, begin + rest.size(), number).ptr;
    const auto is_it = [&](const CudaCard& card) {
      return static_cast<std::size_t>(card.index) == number;
    };
    if (number >= all.size() || std::ranges::any_of(chosen, is_it)) {
      throw refusal(
          fmt::format("must be different numbers below {}, of the cards here", all.size()));
    }
    chosen.push_back(all[number]);
    rest.remove_prefix(static_cast<std::size_t>(end - begin));
  }
  return chosen;
}

CudaDevice::CudaDevice(const CudaCard& card) : cuda_(cuda_functions()), card_(card) {
  check(cuda_.cuDeviceGet(&device_, card.index), "not found");
  check(cuda_.cuDevicePrimaryCtxRetain(&context_, device_), "cannot be opened");
  make_current();
  const auto make_stream = [&](Handle& stream, int priority) {
    check(cuda_.cuStreamCreateWithPriority(&stream, non_blocking_stream, priority), "stream");
  };
  make_stream(copies_, 0);
  make_stream(queues_[0], 0);
  make_stream(queues_[1], first_priority);
  for (Handle& mark : marks_) {
    check(cuda_.cuEventCreate(&mark, blocking_event_without_times), "event");
  }
}

CudaDevice::~CudaDevice() {
  // What fails here has failed before.
  (void)cuda_.cuCtxSetCurrent(context_);
  for (const Address address : memory_) (void)cuda_.cuMemFree_v2(address);
  if (module_ != nullptr) (void)cuda_.cuModuleUnload(module_);
  for (Handle mark : marks_) (void)cuda_.cuEventDestroy_v2(mark);
  for (Handle queue : queues_) (void)cuda_.cuStreamDestroy_v2(queue);
  (void)cuda_.cuStreamDestroy_v2(copies_);
  (void)cuda_.cuDevicePrimaryCtxRelease_v2(device_);
}

void CudaDevice::check(int result, const char* what) const {
  if (result != 0) check_call(cuda_, result, fmt::format("card {}: {}", card_.index, what));
}

void CudaDevice::make_current() const { check(cuda_.cuCtxSetCurrent(context_), "context"); }

void CudaDevice::load(std::string_view program) {
  make_current();
  if (module_ != nullptr) return;
  const std::string text(program);  // Ends with a zero.
  check(cuda_.cuModuleLoadData(&module_, text.c_str()), "driver cannot compile the kernels");
}

CudaDevice::Handle CudaDevice::kernel(std::string_view name) {
  const auto found = kernels_.find(name);
  if (found != kernels_.end()) return found->second;
  const std::string text(name);
  Handle function = nullptr;
  check(cuda_.cuModuleGetFunction(&function, module_, text.c_str()), text.c_str());
  return kernels_[text] = function;
}

std::size_t CudaDevice::num_resident_blocks(std::string_view name, std::size_t num_threads,
                                            std::size_t shared_bytes) {
  Handle function = kernel(name);
  check(cuda_.cuFuncSetAttribute(function, shared_bytes_attribute, static_cast<int>(shared_bytes)),
        "shared memory");
  int num_processors = 0;
  int num_blocks = 0;
  check(cuda_.cuDeviceGetAttribute(&num_processors, num_processors_attribute, device_),
        "processors");
  check(cuda_.cuOccupancyMaxActiveBlocksPerMultiprocessor(
            &num_blocks, function, static_cast<int>(num_threads), shared_bytes),
        "occupancy");
  if (num_blocks == 0) throw DeviceError(fmt::format("card {}: too small", card_.index));
  return static_cast<std::size_t>(num_processors) * static_cast<std::size_t>(num_blocks);
}

std::size_t CudaDevice::free_bytes() {
  std::size_t num_free = 0;
  std::size_t num_total = 0;
  check(cuda_.cuMemGetInfo_v2(&num_free, &num_total), "memory");
  return num_free;
}

CudaDevice::Address CudaDevice::allocate(std::size_t num_bytes) {
  Address address = 0;
  check(cuda_.cuMemAlloc_v2(&address, num_bytes),
        fmt::format("{} bytes of memory", num_bytes).c_str());
  memory_.push_back(address);
  return address;
}

void CudaDevice::release_all() {
  make_current();
  for (Handle queue : queues_) check(cuda_.cuStreamSynchronize(queue), "kernels");
  for (const Address address : memory_) check(cuda_.cuMemFree_v2(address), "memory");
  memory_.clear();
}

void CudaDevice::copy_in(Address to, std::span<const std::byte> from) {
  check(cuda_.cuMemcpyHtoDAsync_v2(to, from.data(), from.size(), copies_), "copy to it");
  check(cuda_.cuStreamSynchronize(copies_), "copy to it");
}

void CudaDevice::copy_out(std::span<std::byte> to, Address from) {
  check(cuda_.cuMemcpyDtoHAsync_v2(to.data(), from, to.size(), copies_), "copy from it");
  check(cuda_.cuStreamSynchronize(copies_), "copy from it");
}

void CudaDevice::launch(Queue queue, const Launch& launch) {
  const auto size = [](std::size_t n) { return static_cast<unsigned>(n); };
  check(cuda_.cuLaunchKernel(kernel(launch.kernel), size(launch.num_blocks),
                             size(launch.num_blocks_y), 1, size(launch.num_threads), 1, 1,
                             size(launch.shared_bytes), queues_[static_cast<std::size_t>(queue)],
                             const_cast<void**>(launch.arguments.data()), nullptr),
        "launch");
}

void CudaDevice::set(Mark mark, Queue queue) {
  check(cuda_.cuEventRecord(marks_[mark], queues_[static_cast<std::size_t>(queue)]), "event");
}

void CudaDevice::wait_in(Queue queue, Mark mark) {
  check(cuda_.cuStreamWaitEvent(queues_[static_cast<std::size_t>(queue)], marks_[mark], 0),
        "event");
}

void CudaDevice::wait(Mark mark) { check(cuda_.cuEventSynchronize(marks_[mark]), "kernels"); }

}  // namespace proofmass::worker
