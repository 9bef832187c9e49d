#define PROOFMASS_RECORD_BATCH record_batch_avx512
#include "core/simulation/batch_kernel-inl.hpp"
