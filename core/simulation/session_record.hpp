#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/estimation/signals.hpp"
#include "core/session/session_signals.hpp"
#include "core/signal/line_weights.hpp"
#include "core/simulation/loop.hpp"

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

/// Weighted sums over a record: [signal][2·line: cosine, 2·line + 1: sine].
template <typename T>
using SignalSums = std::array<std::array<T, 2 * num_fit_lines_max>, num_signals>;

/// The signals of one sample, in the order of `Signal`.
template <typename T>
inline std::array<T, num_signals> ground_signals(const Observation<T>& observation,
                                                 const SharedSample& shared, RegressorKind kind) {
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
          g[1].x,         g[1].y,   g[1].z,   g[2].x,   g[2].y, g[2].z, regressor};
}

/// Runs one session from settling to its last sample and sums its signals.
///
/// @param noise     next() yields the SampleNoise<T> of each sample, settling included.
/// @param progress  Called with the number of record samples done after each block.
template <typename T, typename Noise, typename Progress>
SignalSums<T> record_session(SessionSignals signals, const LineWeights& weights,
                             const LoopConstants<T>& constants, const DragFreeGains& drag_free,
                             const AttitudeGains& attitude, RegressorKind kind, Noise& noise,
                             const Progress& progress) {
  Loop<T> loop;
  for (std::int64_t i = 0; i < signals.num_settling(); ++i) {
    const SharedSample shared = signals.next();
    if (i == 0) loop.begin(shared);
    (void)loop.advance(constants, drag_free, attitude, shared, noise.next());
  }
  SignalSums<T> sums{};
  const std::size_t num_outputs = 2 * weights.num_fit_lines();
  std::vector<double> block_weights(LineWeights::block_size * num_outputs);
  std::size_t num_done = 0;
  for (std::size_t block = 0; block < weights.num_blocks(); ++block) {
    weights.fill_block(block, block_weights);
    const std::size_t num_samples = weights.samples_in(block);
    for (std::size_t k = 0; k < num_samples; ++k) {
      const SharedSample shared = signals.next();
      if (num_done == 0 && k == 0 && signals.num_settling() == 0) loop.begin(shared);
      const Observation<T> observation =
          loop.advance(constants, drag_free, attitude, shared, noise.next());
      const std::array<T, num_signals> values = ground_signals(observation, shared, kind);
      const double* row = &block_weights[k * num_outputs];
      for (std::size_t s = 0; s < num_signals; ++s) {
        for (std::size_t i = 0; i < num_outputs; ++i) {
          sums[s][i] = sums[s][i] + T(row[i]) * values[s];
        }
      }
    }
    num_done += num_samples;
    progress(num_done);
  }
  return sums;
}

}  // namespace proofmass
