#include "core/math/instruction_set.hpp"

#include <array>
#include <cstddef>

namespace proofmass {

std::string_view name_of(InstructionSet set) {
  static constexpr std::array<std::string_view, 5> names{"scalar", "sse4", "avx2", "avx512",
                                                         "neon"};
  return names[static_cast<std::size_t>(set) - 1];
}

#if defined(__aarch64__)

// Every processor of ARM64 has NEON.
std::vector<InstructionSet> available_instruction_sets() {
  return {InstructionSet::scalar, InstructionSet::neon};
}

#else

std::vector<InstructionSet> available_instruction_sets() {
  std::vector<InstructionSet> sets{InstructionSet::scalar};
  if (__builtin_cpu_supports("sse4.2") == 0) return sets;
  sets.push_back(InstructionSet::sse4);
  if (__builtin_cpu_supports("avx2") == 0 || __builtin_cpu_supports("bmi2") == 0) return sets;
  sets.push_back(InstructionSet::avx2);
  if (__builtin_cpu_supports("avx512f") == 0 || __builtin_cpu_supports("avx512dq") == 0 ||
      __builtin_cpu_supports("avx512bw") == 0 || __builtin_cpu_supports("avx512vl") == 0) {
    return sets;
  }
  sets.push_back(InstructionSet::avx512);
  return sets;
}

#endif

InstructionSet best_instruction_set() { return available_instruction_sets().back(); }

}  // namespace proofmass
