#define PROOFMASS_RECORD_BATCH record_batch_avx2
#include "core/simulation/batch_kernel-inl.hpp"
