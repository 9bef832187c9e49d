#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace proofmass {

/// Ways to advance runs; all give the same bits. `scalar` is the reference, one run at a time, and
/// exists on every processor. `sse4`, `avx2` and `avx512` are those of x86-64, `neon` that of
/// ARM64.
enum class InstructionSet : std::uint8_t { scalar = 1, sse4 = 2, avx2 = 3, avx512 = 4, neon = 5 };

/// `scalar`, `sse4`, `avx2`, `avx512`, `neon`.
[[nodiscard]] std::string_view name_of(InstructionSet set);

/// Those that this processor has, slowest first; `scalar` is always there.
[[nodiscard]] std::vector<InstructionSet> available_instruction_sets();

/// The last of available_instruction_sets().
[[nodiscard]] InstructionSet best_instruction_set();

}  // namespace proofmass
