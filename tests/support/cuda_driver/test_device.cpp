#include "tests/support/cuda_driver/test_device.hpp"

#include <dlfcn.h>

#include <stdexcept>

namespace proofmass::test {

// The name libcuda.so.1 is looked up among the libraries that are loaded, before any directory.
void load_driver() {
  if (dlopen(PROOFMASS_TEST_CUDA, RTLD_NOW | RTLD_LOCAL) == nullptr) {
    throw std::runtime_error(dlerror());
  }
}

worker::CudaDevice& device() {
  load_driver();
  static worker::CudaDevice device(worker::cuda_cards_of("all").front());
  return device;
}

}  // namespace proofmass::test
