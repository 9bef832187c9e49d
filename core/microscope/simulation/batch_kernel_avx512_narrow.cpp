#define PROOFMASS_KERNEL_SET avx512_narrow
#define PROOFMASS_KERNEL_VECTORS 1
#include "core/microscope/simulation/batch_kernel-inl.hpp"
