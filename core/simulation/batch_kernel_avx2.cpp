#define PROOFMASS_KERNEL_SET avx2
#include "core/simulation/batch_kernel-inl.hpp"
