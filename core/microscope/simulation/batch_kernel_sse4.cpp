#define PROOFMASS_KERNEL_SET sse4
#define PROOFMASS_KERNEL_VECTORS 2
#include "core/microscope/simulation/batch_kernel-inl.hpp"
