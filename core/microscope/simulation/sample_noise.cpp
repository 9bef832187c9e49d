#include "core/microscope/simulation/sample_noise.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/microscope/control/star_tracker.hpp"
#include "core/random/normal_deviates.hpp"

namespace proofmass {
namespace {

NoiseShape scaled_shape(const SensorNoise& noise, double scale, double sample_period_s) {
  NoiseShape shape = shape_noise(noise, sample_period_s);
  shape.gain *= scale;
  for (double& coefficient : shape.coefficient) coefficient *= scale;
  shape.pair_coefficient = scale * shape.pair_coefficient;
  return shape;
}

}  // namespace

// The one place where noise.scale acts on what is simulated. The outputs of the filters are scaled
// and not the levels that they are made from: shape_noise() needs a white level above 0, which a
// scale of 0 would not leave.
NoiseModel make_noise_model(const NoiseConfig& config, double sample_period_s) {
  const double scale = config.scale;
  const Eigen::Matrix3d star = make_star_tracker(config, sample_period_s).noise_factor_S_rad;
  // A one-sided density A² is the variance A²/(2T) of each sample.
  const double per_sample = scale / std::sqrt(2.0 * sample_period_s);
  const auto shape = [&](const SensorNoise& noise) {
    return scaled_shape(noise, scale, sample_period_s);
  };
  return {.linear_x = {shape(linear_x_of(config, 0)), shape(linear_x_of(config, 1))},
          .linear_yz = {shape(linear_yz_of(config, 0)), shape(linear_yz_of(config, 1))},
          .angular = shape(config.angular),
          .star_tracker_factor = {scale * star(0, 0), scale * star(1, 0), scale * star(1, 1),
                                  scale * star(2, 0), scale * star(2, 1), scale * star(2, 2)},
          .thrust_deviation = config.thrust_asd_m_s2 * per_sample,
          .torque_deviation = config.torque_asd_rad_s2 * per_sample,
          .is_silent = scale == 0.0};
}

const std::array<std::string_view, num_noise_channels>& noise_channel_names() {
  static constexpr std::array<std::string_view, num_noise_channels> names{
      "sensor_1_x",     "sensor_1_y",     "sensor_1_z",      //
      "sensor_2_x",     "sensor_2_y",     "sensor_2_z",      //
      "angular_x",      "angular_y",      "angular_z",       //
      "star_tracker_x", "star_tracker_y", "star_tracker_z",  //
      "thrust_x",       "thrust_y",       "thrust_z",        //
      "torque_x",       "torque_y",       "torque_z"};
  return names;
}

namespace {

NoiseStreams streams_of(std::string_view session, std::size_t num_channels,
                        std::string_view ending) {
  NoiseStreams streams{};
  for (std::size_t channel = 0; channel < num_channels; ++channel) {
    streams[channel] =
        stream_id(fmt::format("session/{}/{}{}", session, noise_channel_names()[channel], ending));
  }
  return streams;
}

}  // namespace

NoiseStreams noise_streams(std::string_view session_name) {
  return streams_of(session_name, num_noise_channels, "");
}

NoiseStreams start_streams(std::string_view session_name) {
  return streams_of(session_name, num_coloured_channels, "/start");
}

namespace {

NoiseState<double> stationary_state(const NoiseShape& shape, const RandomStream& stream) {
  const std::size_t n = shape.num_states();
  std::array<double, NoiseShape::num_poles_max> normals{};
  for (std::size_t i = 0; i < n; ++i) {
    const RandomBlock block = stream.block(static_cast<std::uint32_t>(i / 4));
    normals[i] = static_cast<double>(normal_deviates(block)[i % 4]);
  }
  NoiseState<double> state;
  for (std::size_t i = 0; i < n; ++i) {
    double value = 0.0;
    for (std::size_t j = 0; j <= i; ++j) value += shape.start_factor[i * n + j] * normals[j];
    if (i < shape.num_real) {
      state.real[i] = value;
    } else {
      (i == shape.num_real ? state.pair_real : state.pair_imaginary) = value;
    }
  }
  return state;
}

}  // namespace

NoiseStates<double> stationary_states(const NoiseModel& model, std::uint64_t seed, RunIndex run,
                                      const NoiseStreams& starts) {
  NoiseStates<double> states;
  for (std::size_t channel = 0; channel < num_coloured_channels; ++channel) {
    states[channel] =
        stationary_state(shape_of(model, channel), RandomStream(seed, run, starts[channel]));
  }
  return states;
}

SessionNoise::SessionNoise(const NoiseModel& model, std::uint64_t seed, RunIndex run,
                           std::string_view session_name)
    : model_(&model),
      seed_(seed),
      run_(run),
      streams_(noise_streams(session_name)),
      states_(stationary_states(model, seed, run, start_streams(session_name))) {}

const SampleNoise<double>& SessionNoise::next() {
  if (model_->is_silent) return block_[0];  // Whatever is drawn would be multiplied by 0.
  if (next_in_block_ == samples_per_noise_block) {
    const auto white = [&](std::size_t channel) {
      const RandomStream stream(seed_, run_, streams_[channel]);
      OfSamples<double> deviates;
      std::ranges::copy(normal_deviates(stream.block(num_blocks_)), deviates.begin());
      return deviates;
    };
    shape_block<double>(*model_, states_, white, block_);
    ++num_blocks_;
    next_in_block_ = 0;
  }
  return block_[next_in_block_++];
}

}  // namespace proofmass
