#pragma once

#include "worker/gpu/cuda_device.hpp"

namespace proofmass::test {

/// From now on programs that ask for NVIDIA's driver get the one of the tests.
void load_driver();

/// A card of the tests, one for the whole process.
[[nodiscard]] worker::CudaDevice& device();

}  // namespace proofmass::test
