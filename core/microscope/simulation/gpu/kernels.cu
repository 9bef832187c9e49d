// The two kernels of a launch, for clang as CUDA without NVIDIA's headers; see README.md.

#include "core/microscope/simulation/gpu/sample_kernels-inl.hpp"

#define PROOFMASS_KERNEL extern "C" __attribute__((global))

namespace proofmass::gpu {

/// A block makes one channel of one group of lanes: grid (portions, channels), group_lanes threads.
PROOFMASS_KERNEL void proofmass_noise(Shared shared, const SessionTable* sessions,
                                      GroupMemory memory, const Portion* portions) {
  const std::size_t position = __nvvm_read_ptx_sreg_ctaid_x();
  const std::size_t lane = __nvvm_read_ptx_sreg_tid_x();
  const Portion portion = portions[position];
  if (lane >= portion.num_lanes) return;
  make_noise(shared, sessions, memory, portion, position, __nvvm_read_ptx_sreg_ctaid_y(), lane);
}

extern __attribute__((shared)) std::uint64_t fast_memory[];
__attribute__((shared)) double stage_memory[sizeof(Stage) / sizeof(double)];

/// A block advances one group of lanes: grid (portions), group_lanes threads, words of
/// LoopConstants<double> of a group in shared memory.
PROOFMASS_KERNEL __attribute__((launch_bounds(128, 2))) void proofmass_loop(
    Shared shared, const SessionTable* sessions, GroupMemory memory, const Portion* portions) {
  const std::size_t position = __nvvm_read_ptx_sreg_ctaid_x();
  const Portion portion = portions[position];
  const std::size_t lane = __nvvm_read_ptx_sreg_tid_x();
  if (lane >= portion.num_lanes) return;
  constexpr std::size_t words = num_words<LoopConstants<double>>;
  const std::uint64_t* const constants = memory.constants + portion.slot * words * group_lanes;
  // A thread reads its own lane only, so that none waits for another.
  for (std::size_t i = 0; i < words; ++i) {
    fast_memory[i * group_lanes + lane] = constants[i * group_lanes + lane];
  }
  advance_lane_of({.shared = shared,
                   .session = sessions[portion.session],
                   .memory = memory,
                   .portion = portion,
                   .position = position,
                   .constants = fast_memory,
                   .stage = reinterpret_cast<Stage*>(stage_memory),
                   .threads = {.index = lane, .count = portion.num_lanes}},
                  lane);
}

}  // namespace proofmass::gpu
