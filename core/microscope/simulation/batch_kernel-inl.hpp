#pragma once

// A kernel of one instruction set. Included once by each batch_kernel_<set>.cpp, which is compiled
// with that set's flags and defines PROOFMASS_KERNEL_SET, the ending of the names of the functions
// to be made, and PROOFMASS_KERNEL_VECTORS, the vectors that a quantity of a group of runs fills.
//
// Everything over `Batch` has internal linkage, because `Batch` has: no symbol of this file can be
// taken for another translation unit's, so no code of a faster processor reaches a slower one.

#include <array>
#include <cstddef>
#include <span>
#include <utility>

#include "core/microscope/simulation/batch-inl.hpp"
#include "core/microscope/simulation/batch_gather-inl.hpp"
#include "core/microscope/simulation/batch_kernel.hpp"
#include "core/microscope/simulation/batch_noise-inl.hpp"
#include "core/microscope/simulation/batch_signals-inl.hpp"
#if PROOFMASS_KERNEL_VECTORS == 1
#include "core/microscope/simulation/batch_mixed-inl.hpp"
#endif

namespace proofmass {
namespace {

/// The session's lanes from one on.
template <typename T>
HWY_INLINE std::span<T, num_lanes> lanes_of(std::span<T, batch_lanes> all, std::size_t first_lane) {
  return all.subspan(first_lane).template first<num_lanes>();
}

HWY_INLINE BatchNoise<SharedStreams> make_noise(const BatchSession& session,
                                                std::size_t first_lane) {
  NoiseStates<Batch> states;
  for (std::size_t lane = 0; lane < num_lanes; ++lane) {
    put_lane(states, session.noise_states[first_lane + lane], lane);
  }
  return {session, SharedStreams(*session.streams), first_lane, states};
}

using Group = LaneGroup<Batch, BatchNoise<SharedStreams>>;

template <std::size_t... g>
HWY_INLINE std::array<Group, num_groups> make_groups(const BatchSession& session,
                                                     std::index_sequence<g...> /*groups*/) {
  return {Group{gather_constants(lanes_of(std::span(session.constants), g * num_lanes)),
                make_noise(session, g * num_lanes)}...};
}

using OutcomesOfLanes = std::span<SessionOutcome, num_lanes>;

HWY_INLINE void scatter(const Group& group, const SessionSetup& setup, OutcomesOfLanes outcomes) {
  for (std::size_t lane = 0; lane < num_lanes; ++lane) {
    SessionOutcome& outcome = outcomes[lane];
    outcome.sums = lane_of<SignalSums<double>>(group.sums, lane);
    outcome.health = {.acceleration_m_s2 = lane_of<double>(group.loop.largest_acceleration, lane),
                      .attitude_rad = lane_of<double>(group.loop.largest_angle, lane),
                      .monitor = lane_of<LoopMonitor<double>>(group.monitor, lane)};
    if (!setup.line_readers.empty()) {
      outcome.further = lane_of<FurtherSums<double>>(group.further, lane);
    }
    if (setup.test != nullptr) {
      outcome.test_products = lane_of<TestProducts>(group.test.products, lane);
      outcome.square_steps = lane_of<SquareSteps<double>>(group.test.steps, lane);
    }
  }
}

}  // namespace

#define PROOFMASS_JOIN(a, b) a##b
#define PROOFMASS_NAME(stem, set) PROOFMASS_JOIN(stem, set)

void PROOFMASS_NAME(record_batch_,
                    PROOFMASS_KERNEL_SET)(const BatchSession& session,
                                          std::span<SessionOutcome, batch_lanes> outcomes) {
  BatchSignals signals(*session.signals);
  auto groups = make_groups(session, std::make_index_sequence<num_groups>());
  const auto progress = [&](std::size_t num_samples) {
    session.progress(session.progress_context, num_samples);
  };
  const std::size_t num_used = (session.num_runs + num_lanes - 1) / num_lanes;
  const auto used = std::span(groups).first(num_used);
  for (std::size_t g = 0; g < num_used; ++g) {
    for (std::size_t lane = 0; lane < num_lanes; ++lane) {
      const std::size_t of_session = g * num_lanes + lane;
      put_lane(groups[g].eotvos_parameter, session.eotvos_parameters[of_session], lane);
      groups[g].test.window_weights.runs[lane] = session.window_weights[of_session];
    }
  }
  record_session(signals, session.setup, used, session.weights_buffer, progress, NoObserver{});
  for (std::size_t g = 0; g < num_used; ++g) {
    scatter(groups[g], session.setup, lanes_of(outcomes, g * num_lanes));
  }
}

#if PROOFMASS_KERNEL_VECTORS == 1
void PROOFMASS_NAME(record_mixed_, PROOFMASS_KERNEL_SET)(std::span<const BatchSession> sessions,
                                                         std::span<SessionOutcomes> outcomes) {
  MixedLanes(sessions, outcomes).run();
}
#endif

#undef PROOFMASS_NAME
#undef PROOFMASS_JOIN

}  // namespace proofmass
