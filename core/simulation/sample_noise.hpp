#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/campaign/identifiers.hpp"
#include "core/campaign/scenario.hpp"
#include "core/control/star_tracker.hpp"
#include "core/math/vector3.hpp"
#include "core/random/stream.hpp"
#include "core/signal/noise_shape.hpp"

namespace proofmass {

/// All noise of one sample, SI.
template <typename T>
struct SampleNoise {
  std::array<Vector3<T>, 2> sensor;  ///< Γ_n,k, m/s².
  Vector3<T> angular;                ///< Of the measured angular acceleration, rad/s².
  Vector3<T> star_tracker;           ///< Of the fused angles, rad.
  Vector3<T> thrust;                 ///< Γ_n,DF, m/s².
  Vector3<T> torque;                 ///< Angular actuation, rad/s².
};

/// Colours and levels, the same for every run.
struct NoiseModel {
  NoiseShape linear_x, linear_yz, angular;
  StarTracker star_tracker;
  double thrust_deviation = 0.0;
  double torque_deviation = 0.0;
};

[[nodiscard]] NoiseModel make_noise_model(const NoiseConfig& config, double sample_period_s);

/// Memory of a NoiseShape.
template <typename T>
struct NoiseState {
  std::array<T, NoiseShape::num_poles_max> real{};
  T pair_real{};
  T pair_imaginary{};

  /// The next value, from the next of a white sequence of unit variance.
  T advance(const NoiseShape& shape, const T& white) {
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

/// Names of the channels, which are part of their streams' names; x, y, z for each vector of
/// SampleNoise in its order.
[[nodiscard]] const std::array<std::string_view, num_noise_channels>& noise_channel_names();

/// The noise of one session of one run, sample after sample, started in its stationary state.
/// Channel c of session s draws from the stream `session/s/c`; four samples share a block.
class SessionNoise {
 public:
  SessionNoise(const NoiseModel& model, std::uint64_t seed, RunIndex run,
               std::string_view session_name);

  [[nodiscard]] SampleNoise<double> next();

 private:
  static constexpr std::size_t samples_per_block = 4;
  static constexpr std::size_t num_coloured = 9;

  void start(std::uint64_t seed, RunIndex run, std::string_view session_name);
  [[nodiscard]] const NoiseShape& shape(std::size_t channel) const;

  const NoiseModel* model_;
  std::vector<RandomStream> streams_;
  std::array<NoiseState<double>, num_coloured> states_{};
  std::array<std::array<float, samples_per_block>, num_noise_channels> deviates_{};
  std::uint32_t num_blocks_ = 0;
  std::size_t next_in_block_ = samples_per_block;
};

}  // namespace proofmass
