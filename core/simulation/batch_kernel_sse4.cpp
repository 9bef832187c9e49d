#define PROOFMASS_KERNEL_SET sse4
#include "core/simulation/batch_kernel-inl.hpp"
