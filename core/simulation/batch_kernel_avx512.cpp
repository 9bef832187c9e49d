#define PROOFMASS_KERNEL_SET avx512
#include "core/simulation/batch_kernel-inl.hpp"
