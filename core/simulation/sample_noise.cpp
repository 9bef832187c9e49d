#include "core/simulation/sample_noise.hpp"

#include <fmt/format.h>

#include <cmath>

#include "core/random/normal.hpp"

namespace proofmass {
namespace {

NoiseShape scaled_shape(const SensorNoise& noise, double scale, double sample_period_s) {
  NoiseShape shape = shape_noise(noise, sample_period_s);
  shape.gain *= scale;
  for (double& coefficient : shape.coefficient) coefficient *= scale;
  shape.pair_coefficient *= scale;
  return shape;
}

}  // namespace

NoiseModel make_noise_model(const NoiseConfig& config, double sample_period_s) {
  const double per_sample = config.scale / std::sqrt(2.0 * sample_period_s);
  return {.linear_x = scaled_shape(config.linear_x, config.scale, sample_period_s),
          .linear_yz = scaled_shape(config.linear_yz, config.scale, sample_period_s),
          .angular = scaled_shape(config.angular, config.scale, sample_period_s),
          .star_tracker = make_star_tracker(config, sample_period_s),
          .thrust_deviation = config.thrust_asd_m_s2 * per_sample,
          .torque_deviation = config.torque_asd_rad_s2 * per_sample};
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

SessionNoise::SessionNoise(const NoiseModel& model, std::uint64_t seed, RunIndex run,
                           std::string_view session_name)
    : model_(&model) {
  for (const std::string_view channel : noise_channel_names()) {
    streams_.emplace_back(seed, run,
                          stream_id(fmt::format("session/{}/{}", session_name, channel)));
  }
  start(seed, run, session_name);
}

const NoiseShape& SessionNoise::shape(std::size_t channel) const {
  if (channel >= 6) return model_->angular;
  return channel % 3 == 0 ? model_->linear_x : model_->linear_yz;
}

void SessionNoise::start(std::uint64_t seed, RunIndex run, std::string_view session_name) {
  for (std::size_t channel = 0; channel < num_coloured; ++channel) {
    const RandomStream stream(seed, run,
                              stream_id(fmt::format("session/{}/{}/start", session_name,
                                                    noise_channel_names()[channel])));
    const NoiseShape& colour = shape(channel);
    const std::size_t n = colour.num_states();
    std::array<double, NoiseShape::num_poles_max> normals{};
    for (std::size_t i = 0; i < n; ++i) {
      normals[i] = static_cast<double>(
          normal_deviates(stream.block(static_cast<std::uint32_t>(i / 4)))[i % 4]);
    }
    NoiseState<double>& state = states_[channel];
    for (std::size_t i = 0; i < n; ++i) {
      double value = 0.0;
      for (std::size_t j = 0; j <= i; ++j) value += colour.start_factor[i * n + j] * normals[j];
      if (i < colour.num_real) {
        state.real[i] = value;
      } else {
        (i == colour.num_real ? state.pair_real : state.pair_imaginary) = value;
      }
    }
  }
}

SampleNoise<double> SessionNoise::next() {
  if (next_in_block_ == samples_per_block) {
    for (std::size_t channel = 0; channel < num_noise_channels; ++channel) {
      deviates_[channel] = normal_deviates(streams_[channel].block(num_blocks_));
    }
    ++num_blocks_;
    next_in_block_ = 0;
  }
  const auto white = [this](std::size_t channel) {
    return static_cast<double>(deviates_[channel][next_in_block_]);
  };
  const auto coloured = [&](std::size_t channel, const NoiseShape& colour) {
    return states_[channel].advance(colour, white(channel));
  };
  const auto triple = [&](std::size_t first) {
    return Vector3<double>{white(first), white(first + 1), white(first + 2)};
  };
  SampleNoise<double> noise;
  for (const std::size_t k : {0U, 1U}) {
    noise.sensor[k] = {coloured(3 * k, model_->linear_x), coloured(3 * k + 1, model_->linear_yz),
                       coloured(3 * k + 2, model_->linear_yz)};
  }
  noise.angular = {coloured(6, model_->angular), coloured(7, model_->angular),
                   coloured(8, model_->angular)};
  const Vector3<double> normals = triple(9);
  const Eigen::Matrix3d& factor = model_->star_tracker.noise_factor;
  noise.star_tracker = {
      factor(0, 0) * normals.x, factor(1, 0) * normals.x + factor(1, 1) * normals.y,
      factor(2, 0) * normals.x + factor(2, 1) * normals.y + factor(2, 2) * normals.z};
  noise.thrust = model_->thrust_deviation * triple(12);
  noise.torque = model_->torque_deviation * triple(15);
  ++next_in_block_;
  return noise;
}

}  // namespace proofmass
