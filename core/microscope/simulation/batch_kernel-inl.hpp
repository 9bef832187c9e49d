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

HWY_INLINE NoiseStates<Batch> gather_states(
    std::span<const NoiseStates<double>, num_lanes> states) {
  NoiseStates<Batch> gathered;
  for (std::size_t channel = 0; channel < num_coloured_channels; ++channel) {
    const auto of = [&](std::size_t lane) -> const NoiseState<double>& {
      return states[lane][channel];
    };
    NoiseState<Batch>& state = gathered[channel];
    for (std::size_t i = 0; i < NoiseShape::num_poles_max; ++i) {
      state.real[i] = gather([&](std::size_t lane) { return of(lane).real[i]; });
    }
    state.pair_real = gather([&](std::size_t lane) { return of(lane).pair_real; });
    state.pair_imaginary = gather([&](std::size_t lane) { return of(lane).pair_imaginary; });
  }
  return gathered;
}

/// The session's lanes from one on.
template <typename T>
HWY_INLINE std::span<T, num_lanes> lanes_of(std::span<T, batch_lanes> all, std::size_t first_lane) {
  return all.subspan(first_lane).template first<num_lanes>();
}

HWY_INLINE BatchNoise<SharedStreams> make_noise(const BatchSession& session,
                                                std::size_t first_lane) {
  return {session, SharedStreams(*session.streams), first_lane,
          gather_states(lanes_of(std::span(session.noise_states), first_lane))};
}

using Group = LaneGroup<Batch, BatchNoise<SharedStreams>>;

template <std::size_t... g>
HWY_INLINE std::array<Group, num_groups> make_groups(const BatchSession& session,
                                                     std::index_sequence<g...> /*groups*/) {
  return {Group{gather_constants(lanes_of(std::span(session.constants), g * num_lanes)),
                make_noise(session, g * num_lanes)}...};
}

using OutcomesOfLanes = std::span<SessionOutcome, num_lanes>;

/// Gives each lane its number; place(outcome) is where it belongs.
template <typename Place>
HWY_INLINE void scatter_number(const Batch& numbers, OutcomesOfLanes outcomes, const Place& place) {
  const Lanes values(numbers);
  for (std::size_t lane = 0; lane < num_lanes; ++lane) place(outcomes[lane]) = values[lane];
}

HWY_INLINE void scatter_health(const Group& group, OutcomesOfLanes outcomes) {
  const auto put = [&](const Batch& numbers, const auto& place) {
    scatter_number(numbers, outcomes,
                   [&](SessionOutcome& outcome) -> double& { return place(outcome.health); });
  };
  const LoopMonitor<Batch>& monitor = group.monitor;
  put(group.loop.largest_acceleration,
      [](SessionHealth& h) -> double& { return h.acceleration_m_s2; });
  put(group.loop.largest_angle, [](SessionHealth& h) -> double& { return h.attitude_rad; });
  put(monitor.quadratic.squares, [](SessionHealth& h) -> double& { return h.quadratic_squares; });
  put(monitor.common_square.squares, [](SessionHealth& h) -> double& { return h.common_squares; });
  for (std::size_t k = 0; k < 2; ++k) {
    put(monitor.sensor_square[k].squares,
        [k](SessionHealth& h) -> double& { return h.sensor_squares[k]; });
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < 2; ++i) {
      put(monitor.residual[axis][i],
          [=](SessionHealth& h) -> double& { return h.residual[axis][i]; });
    }
  }
}

HWY_INLINE void scatter(const Group& group, const SessionSetup& setup, OutcomesOfLanes outcomes) {
  constexpr std::size_t num_outputs = 2 * num_fit_lines_max;
  for (std::size_t s = 0; s < num_signals; ++s) {
    for (std::size_t i = 0; i < num_outputs; ++i) {
      scatter_number(group.sums[s][i], outcomes,
                     [&](SessionOutcome& outcome) -> double& { return outcome.sums[s][i]; });
    }
  }
  const std::size_t num_line_readers = setup.line_readers.size();
  for (std::size_t at = 0; at < num_line_readers * num_line_signals * num_outputs; ++at) {
    const std::size_t i = at % num_outputs, s = at / num_outputs % num_line_signals;
    const std::size_t r = at / num_outputs / num_line_signals;
    scatter_number(group.further.lines[r][s][i], outcomes, [=](SessionOutcome& outcome) -> double& {
      return outcome.further.lines[r][s][i];
    });
  }
  for (std::size_t s = 0; s < num_line_bases; ++s) {
    scatter_number(group.further.plain[s], outcomes,
                   [s](SessionOutcome& outcome) -> double& { return outcome.further.plain[s]; });
  }
  for (std::size_t at = 0; setup.test != nullptr && at < num_test_products; ++at) {
    scatter_number(group.test.products[at], outcomes,
                   [at](SessionOutcome& outcome) -> double& { return outcome.test_products[at]; });
  }
  scatter_health(group, outcomes);
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
    groups[g].eotvos_parameter =
        gather([&](std::size_t lane) { return session.eotvos_parameters[g * num_lanes + lane]; });
    for (std::size_t lane = 0; lane < num_lanes; ++lane) {
      groups[g].test.window_weights.runs[lane] = session.window_weights[g * num_lanes + lane];
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
