#define PROOFMASS_KERNEL_SET avx512
#include "core/microscope/simulation/batch_kernel-inl.hpp"
