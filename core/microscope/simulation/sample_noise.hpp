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
  std::array<NoiseShape, 2> linear_x, linear_yz;  ///< Of each sensor, m/s².
  NoiseShape angular;                             ///< rad/s².
  /// Lower triangular factor of the star tracker's covariance: xx, yx, yy, zx, zy, zz, rad.
  std::array<double, 6> star_tracker_factor{};
  double thrust_deviation = 0.0;  ///< Of a sample, each axis, m/s².
  double torque_deviation = 0.0;  ///< Of a sample, each axis, rad/s².
  bool is_silent = false;         ///< All of them are 0.
};

/// The model of a configuration. The only function that applies NoiseConfig::scale to noise: each
/// output of the model is that of scale 1 times the scale, and exactly 0 with scale 0.
[[nodiscard]] NoiseModel make_noise_model(const NoiseConfig& config, double sample_period_s);

inline constexpr std::size_t num_noise_channels = 18;
inline constexpr std::size_t num_coloured_channels = 9;  ///< The first ones.
inline constexpr std::size_t samples_per_noise_block = 4;

/// A number of each sample of a block: of as many samples as one block of random bits serves.
template <typename T>
using OfSamples = std::array<T, samples_per_noise_block>;

/// Memory of a NoiseFilter. It is driven by a white sequence of unit variance and does not depend
/// on noise.scale.
template <typename T>
struct NoiseState {
  std::array<T, NoiseFilter::num_poles_max> real{};
  T pair_real{};
  T pair_imaginary{};

  /// The next values, from the next of a white sequence of unit variance. Pole by pole, so that the
  /// state and the coefficients of a pole are read once for all samples.
  /// @tparam Filter  NoiseFilter, or one whose number of poles the compiler knows.
  template <typename Filter>
  PROOFMASS_INLINE OfSamples<T> advance(const Filter& filter, const OfSamples<T>& white) {
    OfSamples<T> sum;
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] = T(filter.gain) * white[k];
    for (std::size_t i = 0; i < filter.num_real; ++i) {
      const T coefficient = T(filter.coefficient[i]);
      const T pole = T(filter.pole[i]);
      T state = real[i];
      for (std::size_t k = 0; k < sum.size(); ++k) {
        sum[k] = sum[k] + coefficient * state;
        state = pole * state + white[k];
      }
      real[i] = state;
    }
    if (filter.has_pair) advance_pair(filter, white, sum);
    return sum;
  }

 private:
  template <typename Filter>
  PROOFMASS_INLINE void advance_pair(const Filter& filter, const OfSamples<T>& white,
                                     OfSamples<T>& sum) {
    const T twice_real = T(2.0 * filter.pair_coefficient.real());
    const T twice_imaginary = T(2.0 * filter.pair_coefficient.imag());
    const T pole_real = T(filter.pair_pole.real());
    const T pole_imaginary = T(filter.pair_pole.imag());
    for (std::size_t k = 0; k < sum.size(); ++k) {
      sum[k] = sum[k] + twice_real * pair_real - twice_imaginary * pair_imaginary;
      const T rotated = pole_real * pair_real - pole_imaginary * pair_imaginary + white[k];
      pair_imaginary = pole_real * pair_imaginary + pole_imaginary * pair_real;
      pair_real = rotated;
    }
  }
};

template <typename T>
using NoiseStates = std::array<NoiseState<T>, num_coloured_channels>;

/// The filter of a coloured channel.
[[nodiscard]] inline const NoiseShape& shape_of(const NoiseModel& model, std::size_t channel) {
  if (channel >= 6) return model.angular;
  return (channel % 3 == 0 ? model.linear_x : model.linear_yz)[channel / 3];
}

/// Where a coloured channel's value goes: x, y, z of each sensor, then of the angular measurement.
template <typename T>
PROOFMASS_INLINE T& coloured_place(SampleNoise<T>& noise, std::size_t channel) {
  return (channel < 6 ? noise.sensor_K[channel / 3] : noise.angular_S)[channel % 3];
}

/// Sets the noise of the channels without colour.
/// @tparam Levels  NoiseModel, or what has its levels.
/// @param white    white(c) yields the deviate of channel c, for c from num_coloured_channels on.
template <typename T, typename Levels, typename White>
PROOFMASS_INLINE void set_white(const Levels& levels, const White& white, SampleNoise<T>& noise) {
  const Vector3<T> star{white(9), white(10), white(11)};
  const auto& factor = levels.star_tracker_factor;
  noise.star_tracker_S = {T(factor[0]) * star.x, T(factor[1]) * star.x + T(factor[2]) * star.y,
                          T(factor[3]) * star.x + T(factor[4]) * star.y + T(factor[5]) * star.z};
  noise.thrust_S = T(levels.thrust_deviation) * Vector3<T>{white(12), white(13), white(14)};
  noise.torque_S = T(levels.torque_deviation) * Vector3<T>{white(15), white(16), white(17)};
}

/// The noise of a block of samples from white numbers.
/// @param white  white(c) yields the next deviates of channel c as OfSamples<T>.
template <typename T, typename White>
PROOFMASS_INLINE void shape_block(const NoiseModel& model, NoiseStates<T>& states,
                                  const White& white, OfSamples<SampleNoise<T>>& block) {
  for (std::size_t channel = 0; channel < num_coloured_channels; ++channel) {
    const OfSamples<T> values =
        states[channel].template advance<NoiseFilter>(shape_of(model, channel), white(channel));
    for (std::size_t k = 0; k < values.size(); ++k) coloured_place(block[k], channel) = values[k];
  }
  std::array<OfSamples<T>, num_noise_channels> rest;
  for (std::size_t channel = num_coloured_channels; channel < rest.size(); ++channel) {
    rest[channel] = white(channel);
  }
  for (std::size_t k = 0; k < block.size(); ++k) {
    set_white(
        model, [&](std::size_t channel) { return rest[channel][k]; }, block[k]);
  }
}

/// Names of the channels, which are part of their streams' names; x, y, z for each vector of
/// SampleNoise in its order.
[[nodiscard]] const std::array<std::string_view, num_noise_channels>& noise_channel_names();

/// Stream of each channel in a session.
using NoiseStreams = std::array<std::uint32_t, num_noise_channels>;
[[nodiscard]] NoiseStreams noise_streams(std::string_view session_name);

/// Streams that the states at the start of a session are drawn from: `session/s/c/start`, for the
/// coloured channels.
[[nodiscard]] NoiseStreams start_streams(std::string_view session_name);

/// Stationary states of a run's coloured channels at the start of a session.
/// @param starts  start_streams() of the session, whose names take longer than the states.
[[nodiscard]] NoiseStates<double> stationary_states(const NoiseModel& model, std::uint64_t seed,
                                                    RunIndex run, const NoiseStreams& starts);

/// The noise of one session of one run, sample after sample, started in its stationary state.
/// Channel c of session s draws from the stream `session/s/c`; four samples share a block.
class SessionNoise {
 public:
  /// @param model  Must outlive this object.
  SessionNoise(const NoiseModel& model, std::uint64_t seed, RunIndex run,
               std::string_view session_name);

  /// The reference holds until the next call.
  [[nodiscard]] const SampleNoise<double>& next();

 private:
  const NoiseModel* model_;
  std::uint64_t seed_;
  RunIndex run_;
  NoiseStreams streams_;
  NoiseStates<double> states_;
  OfSamples<SampleNoise<double>> block_{};
  std::uint32_t num_blocks_ = 0;
  std::size_t next_in_block_ = samples_per_noise_block;
};

}  // namespace proofmass
