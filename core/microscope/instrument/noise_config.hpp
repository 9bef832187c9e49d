#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "core/signal/sensor_noise.hpp"

namespace proofmass {

/// A complete set of noise levels.
enum class NoisePreset : std::uint8_t {
  design_2013 = 1,   ///< What the sensors were designed for; the paper's level.
  flight_suref = 2,  ///< X as measured in flight by the sensor unit SUREF.
};

/// Spelling of an enumerator in campaign files; the list of all of them, in value order from 1.
[[nodiscard]] std::span<const std::string_view> names_of(NoisePreset);

/// Noise of the sensors, of the star tracker and of the actuators: `[noise]` of a campaign file.
/// All densities are one-sided amplitude densities.
struct NoiseConfig {
  NoisePreset preset = NoisePreset::design_2013;
  /// Multiplies every noise of the simulation; 0 switches all of it off. It acts on what is
  /// simulated in make_noise_model() alone: the levels below stay those of scale 1. The limit of
  /// LoopHealth::quadratic_noise, a ratio to the sensors' noise, follows it (judge_health()).
  double scale = 1.0;
  SensorNoise linear_x;   ///< Each sensor, sensitive axis, m/s².
  SensorNoise linear_yz;  ///< Each sensor, Y and Z, m/s².
  SensorNoise angular;    ///< Measured angular acceleration, each axis, rad/s².
  double star_tracker_across_asd_rad = 7e-6;       ///< One head, across its boresight, rad/√Hz.
  double star_tracker_boresight_asd_rad = 3.5e-5;  ///< One head, about its boresight, rad/√Hz.
  double thrust_asd_m_s2 = 4.7e-10;                ///< Propulsion, each axis, (m/s²)/√Hz.
  double torque_asd_rad_s2 = 1e-9;                 ///< Attitude actuation, each, (rad/s²)/√Hz.

  NoiseConfig();  ///< The preset `design_2013`.
};

/// All of a preset's noise, with scale 1.
[[nodiscard]] NoiseConfig noise_preset(NoisePreset preset);

}  // namespace proofmass
