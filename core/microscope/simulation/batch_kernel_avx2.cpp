#define PROOFMASS_KERNEL_SET avx2
#include "core/microscope/simulation/batch_kernel-inl.hpp"
