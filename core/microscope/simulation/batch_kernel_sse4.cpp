#define PROOFMASS_KERNEL_SET sse4
#include "core/microscope/simulation/batch_kernel-inl.hpp"
