#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/math/instruction_set.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/microscope/simulation/session_record.hpp"

namespace proofmass {

/// What one session of a batch of runs is computed from. A lane is a run; lanes that no run fills
/// repeat another's. Pointers are borrowed for the call and not null.
struct BatchSession {
  SessionSignals* signals = nullptr;      ///< Not yet asked for any sample.
  SessionSetup setup;                     ///< What the runs share.
  const NoiseModel* noise = nullptr;      ///< That all runs share.
  const NoiseStreams* streams = nullptr;  ///< Of the session.
  std::uint64_t seed = 0;                 ///< Of the campaign.
  std::size_t num_runs = batch_lanes;     ///< At least 1; in the first lanes.
  std::array<RunIndex, batch_lanes> runs{};
  std::array<LoopConstants<double>, batch_lanes> constants{};
  std::array<NoiseStates<double>, batch_lanes> noise_states{};
  std::array<double, batch_lanes> eotvos_parameters{};  ///< Read in a test session alone.
  /// Of the windows of each lane, null if each counts once; read in a test session alone.
  std::array<const float*, batch_lanes> window_weights{};
  std::span<double> weights_buffer;  ///< Room for a block of weights.
  /// Called with the number of record samples done, after each block or more often.
  void (*progress)(const void* context, std::size_t num_samples) = nullptr;
  const void* progress_context = nullptr;
};

using SessionOutcomes = std::array<SessionOutcome, batch_lanes>;  ///< Of each lane.

/// record_session() for batch_lanes runs at once, into one outcome a lane, the same bits as for
/// each alone.
using BatchKernel = void (*)(const BatchSession& session,
                             std::span<SessionOutcome, batch_lanes> outcomes);

/// Records several sessions of the same runs, which are computed side by side as far as there are
/// lanes, into the outcomes of each session. Signals are summed whether or not the session
/// records them.
///
/// @param sessions  Of the same runs, noise, gains and settling. They begin in this order: the
///                  longest first takes the least time. The progress of the first one is called for
///                  all, with the samples of all records times the part of the work that is done.
using MixedKernel = void (*)(std::span<const BatchSession> sessions,
                             std::span<SessionOutcomes> outcomes);

// One for each instruction set that has more than one lane; compiled with that set's flags, to be
// called only where available_instruction_sets() holds it. Those of other processors than the one
// that the program is built for are not defined.
void record_batch_sse4(const BatchSession& session,
                       std::span<SessionOutcome, batch_lanes> outcomes);
void record_batch_avx2(const BatchSession& session,
                       std::span<SessionOutcome, batch_lanes> outcomes);
void record_batch_avx512(const BatchSession& session,
                         std::span<SessionOutcome, batch_lanes> outcomes);
void record_batch_neon(const BatchSession& session,
                       std::span<SessionOutcome, batch_lanes> outcomes);
// For groups of half as many runs: 4 and 8.
void record_batch_avx2_narrow(const BatchSession& session,
                              std::span<SessionOutcome, batch_lanes> outcomes);
void record_batch_avx512_narrow(const BatchSession& session,
                                std::span<SessionOutcome, batch_lanes> outcomes);

void record_mixed_avx2_narrow(std::span<const BatchSession> sessions,
                              std::span<SessionOutcomes> outcomes);
void record_mixed_avx512_narrow(std::span<const BatchSession> sessions,
                                std::span<SessionOutcomes> outcomes);

/// The kernel that computes several sessions of so few runs side by side; null if the set has none,
/// or no lanes for a second session.
[[nodiscard]] MixedKernel mixed_kernel(InstructionSet set, std::size_t num_runs);

/// The kernel that takes the least time for so many runs, one session after the other.
/// @pre set is not `scalar`; 1 ≤ num_runs ≤ batch_lanes.
[[nodiscard]] BatchKernel batch_kernel(InstructionSet set, std::size_t num_runs);

}  // namespace proofmass
