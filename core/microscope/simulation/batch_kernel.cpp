#include "core/microscope/simulation/batch_kernel.hpp"

#include "core/error.hpp"

namespace proofmass {

#if defined(__aarch64__)

MixedKernel mixed_kernel(InstructionSet /*set*/, std::size_t /*num_runs*/) { return nullptr; }

BatchKernel batch_kernel(InstructionSet set, std::size_t /*num_runs*/) {
  PROOFMASS_EXPECT(set == InstructionSet::neon);
  return record_batch_neon;
}

#else

MixedKernel mixed_kernel(InstructionSet set, std::size_t num_runs) {
  if (set == InstructionSet::avx2 && num_runs <= 2) return record_mixed_avx2_narrow;
  if (set == InstructionSet::avx512 && num_runs <= 4) return record_mixed_avx512_narrow;
  return nullptr;
}

BatchKernel batch_kernel(InstructionSet set, std::size_t num_runs) {
  PROOFMASS_EXPECT(set != InstructionSet::scalar);
  if (set == InstructionSet::sse4) return record_batch_sse4;
  if (set == InstructionSet::avx2) {
    return num_runs <= 4 ? record_batch_avx2_narrow : record_batch_avx2;
  }
  return num_runs <= 8 ? record_batch_avx512_narrow : record_batch_avx512;
}

#endif

}  // namespace proofmass
