#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/estimation/signals.hpp"
#include "core/math/inline.hpp"
#include "core/session/session_signals.hpp"
#include "core/signal/line_weights.hpp"
#include "core/simulation/loop.hpp"
#include "core/simulation/loop_monitor.hpp"

namespace proofmass {

/// The product that a session's target needs beside the common signals.
enum class RegressorKind : std::uint8_t {
  none,
  common_squared,    ///< Γ_mes,cx².
  sensor_1_squared,  ///< Γ_mes,1x².
  sensor_2_squared,  ///< Γ_mes,2x².
  modulated_yy,      ///< ½([T̂]_yy − [T̂]_xx) Δ_TM sin(2π f_TM t).
  modulated_zz,      ///< ½([T̂]_zz − [T̂]_xx) Δ_TM sin(2π f_TM t).
};

[[nodiscard]] RegressorKind regressor_kind(SessionTarget target);

/// How many signals, in their order, the target's estimate needs.
[[nodiscard]] std::size_t num_signals_used(SessionTarget target);

/// Weighted sums over a record: [signal][2·line: cosine, 2·line + 1: sine].
template <typename T>
using SignalSums = std::array<std::array<T, 2 * num_fit_lines_max>, num_signals>;

/// The signals of one sample, in the order of `Signal`.
template <typename T>
PROOFMASS_INLINE std::array<T, num_signals> ground_signals(const Observation<T>& observation,
                                                           const SharedSample& shared,
                                                           RegressorKind kind) {
  const Vector3<T>& m1 = observation.measured[0];
  const Vector3<T>& m2 = observation.measured[1];
  const T half = T(0.5);
  const T differential_x = half * (m1.x - m2.x);
  const Vector3<T> common = half * (m1 + m2);

  // The ground knows what was commanded and takes it out of the on-board estimate, which followed
  // the star tracker with the command in it.
  const Vector3<T> angle = observation.attitude.angle - broadcast<T>(shared.commanded.angle);
  const Vector3<T> rate = observation.attitude.rate - broadcast<T>(shared.commanded.rate) +
                          broadcast<T>(shared.reference_rate);
  const Vector3<T> direction =
      to_target(from_error_angles(angle), broadcast<T>(shared.earth_direction_R));
  const auto [g] =
      gradient_matrix(shared.gradient_s2, direction, rate, observation.measured_angular);

  T regressor = T(0.0);
  const T motion = T(0.5 * shared.mass_motion.position_m);
  switch (kind) {
    case RegressorKind::none:
      break;
    case RegressorKind::common_squared:
      regressor = common.x * common.x;
      break;
    case RegressorKind::sensor_1_squared:
      regressor = m1.x * m1.x;
      break;
    case RegressorKind::sensor_2_squared:
      regressor = m2.x * m2.x;
      break;
    case RegressorKind::modulated_yy:
      regressor = (g[1].y - g[0].x) * motion;
      break;
    case RegressorKind::modulated_zz:
      regressor = (g[2].z - g[0].x) * motion;
      break;
  }
  return {differential_x, common.x, common.y, common.z, g[0].x, g[0].y, g[0].z,
          regressor,      g[1].x,   g[1].y,   g[1].z,   g[2].x, g[2].y, g[2].z};
}

/// What the runs of a batch share in one session.
struct SessionSetup {
  WeightReader* reader = nullptr;
  DragFreeGains drag_free;
  AttitudeGains attitude;
  RegressorKind regressor = RegressorKind::none;
  std::size_t num_signals_used = num_signals;  ///< num_common_signals or all.
  /// Weights of the line at f_EP; null in a session that is not monitored.
  WeightReader* residual_reader = nullptr;
};

/// Weights of a block of samples.
struct BlockWeights {
  const double* lines = nullptr;     ///< Of the session's lines; null while the loops settle.
  const double* residual = nullptr;  ///< Of the line at f_EP; null where it is not monitored.
};

/// Adds one sample's signals to the sums of one output of the line weights.
template <std::size_t first, std::size_t last, typename T>
PROOFMASS_INLINE void add_weighted(const std::array<T, num_signals>& values, const T& weight,
                                   std::size_t output, SignalSums<T>& sums) {
  for (std::size_t s = first; s < last; ++s) {
    sums[s][output] = sums[s][output] + weight * values[s];
  }
}

/// Adds one sample's signals to the sums of every output.
template <typename T>
PROOFMASS_INLINE void add_sample(const std::array<T, num_signals>& values, const double* weights,
                                 std::size_t num_outputs, std::size_t num_used,
                                 SignalSums<T>& sums) {
  for (std::size_t i = 0; i < num_outputs; ++i) {
    const T weight = T(weights[i]);
    add_weighted<0, num_common_signals>(values, weight, i, sums);
    if (num_used == num_signals) {
      add_weighted<num_common_signals, num_signals>(values, weight, i, sums);
    }
  }
}

/// Weights of a block for the session's lines and for that at f_EP.
[[nodiscard]] constexpr std::size_t weights_buffer_size(std::size_t num_fit_lines) {
  return LineWeights::block_size * 2 * (num_fit_lines + 1);
}

/// The runs that one T holds, in one session.
template <typename T, typename Noise>
struct LaneGroup {
  LoopConstants<T> constants;
  Noise noise;  ///< next() yields the SampleNoise<T> of each sample, settling included.
  Loop<T> loop{};
  SignalSums<T> sums{};
  LoopMonitor<T> monitor{};
};

/// What a session leaves of a run.
struct SessionOutcome {
  SignalSums<double> sums{};
  SessionHealth health;
};

/// Advances all groups by some samples.
/// @param weights  Of these samples; none while the loops settle, when nothing is summed.
template <typename Signals, typename Group>
__attribute__((noinline)) void advance_groups(Signals& signals, const SessionSetup& setup,
                                              std::span<Group> groups, std::size_t num_samples,
                                              const BlockWeights& weights) {
  const std::size_t num_outputs = 2 * setup.reader->weights().num_fit_lines();
  for (std::size_t k = 0; k < num_samples; ++k) {
    const SharedSample& shared = signals.next();
    for (auto& [constants, noise, loop, sums, monitor] : groups) {
      const auto observation = loop.advance(constants, setup.drag_free, setup.attitude, shared,
                                            noise.next(), k % 4 == 0 ? Watch::yes : Watch::no);
      if (weights.lines == nullptr) continue;
      add_sample(ground_signals(observation, shared, setup.regressor),
                 weights.lines + k * num_outputs, num_outputs, setup.num_signals_used, sums);
      if (weights.residual == nullptr) continue;
      monitor.add(constants.sensors, observation, weights.residual + 2 * k);
    }
  }
}

/// Runs one session from settling to its last sample and sums its signals.
///
/// @param signals   Like SessionSignals, not yet asked for any sample.
/// @param groups    With zero sums and a loop that has not begun.
/// @param buffer    Room for weights_buffer_size() weights.
/// @param progress  Called with the number of record samples done after each block.
template <typename Signals, typename Group, typename Progress>
inline void record_session(Signals& signals, const SessionSetup& setup, std::span<Group> groups,
                           std::span<double> buffer, const Progress& progress) {
  for (Group& group : groups) group.loop.begin(signals.reference_at_start());
  advance_groups(signals, setup, groups, static_cast<std::size_t>(signals.num_settling()), {});
  for (Group& group : groups) group.loop.begin_record();
  const LineWeights& weights = setup.reader->weights();
  std::size_t num_done = 0;
  for (std::size_t block = 0; block < weights.num_blocks(); ++block) {
    setup.reader->fill_block(block, buffer);
    BlockWeights block_weights{.lines = buffer.data()};
    if (setup.residual_reader != nullptr) {
      const std::span<double> residual = buffer.last(2 * LineWeights::block_size);
      setup.residual_reader->fill_block(block, residual);
      block_weights.residual = residual.data();
    }
    const std::size_t num_samples = weights.samples_in(block);
    advance_groups(signals, setup, groups, num_samples, block_weights);
    // A block that is not full has a sum of its own size.
    if (num_samples == LineWeights::block_size) {
      for (Group& group : groups) group.monitor.end_block(block == 0);
    }
    num_done += num_samples;
    progress(num_done);
  }
}

}  // namespace proofmass
