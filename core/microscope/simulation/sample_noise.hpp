#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"
#include "core/microscope/instrument/noise_config.hpp"
#include "core/random/stream.hpp"
#include "core/runs.hpp"
#include "core/signal/noise_shape.hpp"

namespace proofmass {

// The noise of a run, sample after sample. Which densities it has follows from a NoiseConfig alone:
// make_noise_model() turns them, with noise.scale, into filters and deviations that all runs share.

/// All noise of one sample.
template <typename T>
struct SampleNoise {
  std::array<Vector3<T>, 2> sensor_K;  ///< Γ_n,k, in the frame of sensor k, m/s².
  Vector3<T> angular_S;                ///< Of the measured angular acceleration, rad/s².
  Vector3<T> star_tracker_S;           ///< Of the fused angles, rad.
  Vector3<T> thrust_S;                 ///< Γ_n,DF, m/s².
  Vector3<T> torque_S;                 ///< Angular actuation, rad/s².
};

/// Colours and levels, the same for every run; noise.scale is in all of them.
struct NoiseModel {
  NoiseShape linear_x, linear_yz, angular;  ///< m/s², m/s², rad/s².
  /// Lower triangular factor of the star tracker's covariance: xx, yx, yy, zx, zy, zz, rad.
  std::array<double, 6> star_tracker_factor{};
  double thrust_deviation = 0.0;  ///< Of a sample, each axis, m/s².
  double torque_deviation = 0.0;  ///< Of a sample, each axis, rad/s².
};

/// The model of a configuration. The only function that applies NoiseConfig::scale to noise: each
/// output of the model is that of scale 1 times the scale, and exactly 0 with scale 0.
[[nodiscard]] NoiseModel make_noise_model(const NoiseConfig& config, double sample_period_s);

/// Memory of a NoiseShape. It is driven by a white sequence of unit variance and does not depend on
/// noise.scale.
template <typename T>
struct NoiseState {
  std::array<T, NoiseShape::num_poles_max> real{};
  T pair_real{};
  T pair_imaginary{};

  /// The next value, from the next of a white sequence of unit variance.
  PROOFMASS_INLINE T advance(const NoiseShape& shape, const T& white) {
    T sum = T(shape.gain) * white;
    for (std::size_t i = 0; i < shape.num_real; ++i) {
      sum = sum + T(shape.coefficient[i]) * real[i];
      real[i] = T(shape.pole[i]) * real[i] + white;
    }
    if (shape.has_pair) {
      sum = sum + T(2.0 * shape.pair_coefficient.real()) * pair_real -
            T(2.0 * shape.pair_coefficient.imag()) * pair_imaginary;
      const T rotated = T(shape.pair_pole.real()) * pair_real -
                        T(shape.pair_pole.imag()) * pair_imaginary + white;
      pair_imaginary =
          T(shape.pair_pole.real()) * pair_imaginary + T(shape.pair_pole.imag()) * pair_real;
      pair_real = rotated;
    }
    return sum;
  }
};

inline constexpr std::size_t num_noise_channels = 18;
inline constexpr std::size_t num_coloured_channels = 9;  ///< The first ones.
inline constexpr std::size_t samples_per_noise_block = 4;

template <typename T>
using NoiseStates = std::array<NoiseState<T>, num_coloured_channels>;

/// One sample of noise from a white number for each channel.
/// @param white  white(c) yields the next deviate of channel c as T.
template <typename T, typename White>
PROOFMASS_INLINE SampleNoise<T> shape_sample(const NoiseModel& model, NoiseStates<T>& states,
                                             const White& white) {
  const auto triple = [&](std::size_t first) {
    return Vector3<T>{white(first), white(first + 1), white(first + 2)};
  };
  SampleNoise<T> noise;
  for (std::size_t k = 0; k < 2; ++k) {
    noise.sensor_K[k] = {states[3 * k].advance(model.linear_x, white(3 * k)),
                         states[3 * k + 1].advance(model.linear_yz, white(3 * k + 1)),
                         states[3 * k + 2].advance(model.linear_yz, white(3 * k + 2))};
  }
  noise.angular_S = {states[6].advance(model.angular, white(6)),
                     states[7].advance(model.angular, white(7)),
                     states[8].advance(model.angular, white(8))};
  const Vector3<T> star = triple(9);
  const std::array<double, 6>& factor = model.star_tracker_factor;
  noise.star_tracker_S = {T(factor[0]) * star.x, T(factor[1]) * star.x + T(factor[2]) * star.y,
                          T(factor[3]) * star.x + T(factor[4]) * star.y + T(factor[5]) * star.z};
  noise.thrust_S = T(model.thrust_deviation) * triple(12);
  noise.torque_S = T(model.torque_deviation) * triple(15);
  return noise;
}

/// Names of the channels, which are part of their streams' names; x, y, z for each vector of
/// SampleNoise in its order.
[[nodiscard]] const std::array<std::string_view, num_noise_channels>& noise_channel_names();

/// Stream of each channel in a session.
using NoiseStreams = std::array<std::uint32_t, num_noise_channels>;
[[nodiscard]] NoiseStreams noise_streams(std::string_view session_name);

/// Stationary states of a run's coloured channels at the start of a session, drawn from the streams
/// `session/s/c/start`.
[[nodiscard]] NoiseStates<double> stationary_states(const NoiseModel& model, std::uint64_t seed,
                                                    RunIndex run, std::string_view session_name);

/// The noise of one session of one run, sample after sample, started in its stationary state.
/// Channel c of session s draws from the stream `session/s/c`; four samples share a block.
class SessionNoise {
 public:
  /// @param model  Must outlive this object.
  SessionNoise(const NoiseModel& model, std::uint64_t seed, RunIndex run,
               std::string_view session_name);

  [[nodiscard]] SampleNoise<double> next();

 private:
  const NoiseModel* model_;
  std::uint64_t seed_;
  RunIndex run_;
  NoiseStreams streams_;
  NoiseStates<double> states_;
  std::array<std::array<float, samples_per_noise_block>, num_noise_channels> deviates_{};
  std::uint32_t num_blocks_ = 0;
  std::size_t next_in_block_ = samples_per_noise_block;
};

}  // namespace proofmass
