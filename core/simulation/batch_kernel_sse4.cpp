#define PROOFMASS_RECORD_BATCH record_batch_sse4
#include "core/simulation/batch_kernel-inl.hpp"
