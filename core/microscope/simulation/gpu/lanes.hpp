#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "core/math/inline.hpp"
#include "core/microscope/simulation/session_record.hpp"

namespace proofmass::gpu {

// What host and device exchange. A lane is one run in one session. Lanes come in groups, each of
// one session, which a block of threads serves; memory of a group holds word after word, each of
// all lanes, so that neighbouring threads read neighbouring words.

inline constexpr std::size_t group_lanes = 128;

/// A state, which consists of doubles or is padded to them, in eight-byte words.
template <typename State>
inline constexpr std::size_t num_words = sizeof(State) / sizeof(std::uint64_t);
template <typename State>
using Words = std::array<std::uint64_t, num_words<State>>;

template <typename State>
PROOFMASS_INLINE State load_words(const std::uint64_t* memory, std::size_t lane) {
  Words<State> words;
  for (std::size_t i = 0; i < words.size(); ++i) words[i] = memory[i * group_lanes + lane];
  return __builtin_bit_cast(State, words);
}

template <typename State>
PROOFMASS_INLINE void store_words(const State& state, std::uint64_t* memory, std::size_t lane) {
  const auto words = __builtin_bit_cast(Words<State>, state);
  for (std::size_t i = 0; i < words.size(); ++i) memory[i * group_lanes + lane] = words[i];
}

/// Filters with more real poles are left to processors.
inline constexpr std::size_t num_device_poles_max = 8;

/// Numbers of the loops that all runs and sessions share.
struct Shared {
  std::array<NoiseFilter, 3> filter;  ///< linear_x, linear_yz, angular.
  std::array<double, 6> star_tracker_factor;
  double thrust_deviation;
  double torque_deviation;
  DragFreeGains drag_free;
  AttitudeGains attitude;
  std::uint64_t seed;
};

/// A session, with arrays in the device's memory.
struct SessionTable {
  const SharedSample* samples;  ///< Settling, then the record.
  const double* weights;        ///< Of the record: [sample][2 · num_lines].
  const double* residual;       ///< Of the record: [sample][2]; null unless it is monitored.
  std::uint64_t num_settling;
  SessionSignals::Reference reference;  ///< At the first sample.
  std::array<std::uint32_t, num_noise_channels> streams;
  std::uint32_t num_lines;
  std::uint32_t kind;  ///< Index into sample_kinds.
  Product product;
  SignalSet signals;
};

/// What a launch does with a group of lanes: samples [first, first + count), settling included.
struct Portion {
  std::uint32_t session;
  std::uint32_t slot;       ///< Of the group's memory.
  std::uint32_t num_lanes;  ///< Those that have a run.
  std::uint64_t first;      ///< A multiple of samples_per_noise_block.
  std::uint32_t count;      ///< At most launch_samples; ends where the session does, or as `first`.
};

/// Loop, sums and monitor of a lane between two launches.
struct LaneState {
  Loop<double> loop;
  SignalSums<double> sums;
  LoopMonitor<double> monitor;
};

/// The noise of one sample in a group's memory: coloured channels as doubles, then the deviates of
/// the others as floats.
inline constexpr std::size_t num_white_channels = num_noise_channels - num_coloured_channels;
inline constexpr std::size_t noise_sample_bytes =
    group_lanes * (num_coloured_channels * sizeof(double) + num_white_channels * sizeof(float));

/// Memory of the groups, by slot.
struct GroupMemory {
  std::uint64_t* runs;          ///< [slot][lane]: numbers of the runs.
  std::uint64_t* constants;     ///< [slot]: words of LoopConstants<double>.
  std::uint64_t* noise_states;  ///< [slot][channel]: words of NoiseState<double>.
  std::uint64_t* states;        ///< [slot]: words of LaneState.
  std::byte* noise;             ///< [portion of the launch][sample]: noise_sample_bytes.
  std::uint32_t launch_samples;
};

}  // namespace proofmass::gpu
