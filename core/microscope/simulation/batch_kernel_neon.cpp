#define PROOFMASS_KERNEL_SET neon
#define PROOFMASS_KERNEL_VECTORS 2
#include "core/microscope/simulation/batch_kernel-inl.hpp"
