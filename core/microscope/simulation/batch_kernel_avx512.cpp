#define PROOFMASS_KERNEL_SET avx512
#define PROOFMASS_KERNEL_VECTORS 2
#include "core/microscope/simulation/batch_kernel-inl.hpp"
