#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/signal/noise_shape.hpp"

namespace proofmass {

/// A complete set of noise levels.
enum class NoisePreset : std::uint8_t {
  design_2013 = 1,   ///< What the sensors were designed for; the paper's level.
  flight_suref = 2,  ///< X as measured in flight by the sensor unit SUREF.
  /// What the wires make of the 1/f noise along X in each unit; all else as `flight_suref`.
  wire_suref = 3,
  wire_suep = 4,
};

/// Spelling of an enumerator in campaign files; the list of all of them, in value order from 1.
[[nodiscard]] std::span<const std::string_view> names_of(NoisePreset);

/// Damping of the gold wire that keeps each test mass at a potential: `[noise.wire]` of a campaign
/// file. Without damping there is none of its noise.
struct WireConfig {
  double damping_n_m = 0.0;  ///< k/Q along X: stiffness over quality factor.
  double temperature_k = 293.0;
  std::array<double, 2> mass_kg{0.401533, 1.359813};  ///< Test mass of each sensor; SUREF's.
  /// Multiplies the amplitude in each sensor. The law is disputed ([Nobili2024]), and what flew
  /// differs from it by factors up to 2.5.
  std::array<double, 2> factor{1.0, 1.0};
};

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
  /// Multiplies both of these in each sensor, but not what the wire adds.
  std::array<double, 2> linear_factor{1.0, 1.0};
  WireConfig wire;      ///< Adds to the 1/f part along X.
  SensorNoise angular;  ///< Measured angular acceleration, each axis, rad/s².
  double star_tracker_across_asd_rad = 7e-6;       ///< One head, across its boresight, rad/√Hz.
  double star_tracker_boresight_asd_rad = 3.5e-5;  ///< One head, about its boresight, rad/√Hz.
  double thrust_asd_m_s2 = 4.7e-10;                ///< Propulsion, each axis, (m/s²)/√Hz.
  double torque_asd_rad_s2 = 1e-9;                 ///< Attitude actuation, each, (rad/s²)/√Hz.

  NoiseConfig();  ///< The preset `design_2013`.
};

/// All of a preset's noise, with scale 1.
[[nodiscard]] NoiseConfig noise_preset(NoisePreset preset);

/// Noise of a sensor along X, with its wire; of scale 1.
/// @param sensor  0 or 1.
[[nodiscard]] SensorNoise linear_x_of(const NoiseConfig& noise, std::size_t sensor);

/// A sensor whose density along X is the mean of both: two of it make the noise of Γ_mes,dx.
[[nodiscard]] SensorNoise mean_linear_x(const NoiseConfig& noise);

/// Noise of a sensor along Y and Z; of scale 1.
[[nodiscard]] SensorNoise linear_yz_of(const NoiseConfig& noise, std::size_t sensor);

/// One-sided density of Γ_mes,dx, (m/s²)²/Hz; of scale 1. It is half the difference of two sensors
/// whose noise is independent: S_d = ¼(S_1 + S_2).
/// @param density_of  Of a sensor's noise along X.
template <typename DensityOf>
[[nodiscard]] double differential_x_density(const NoiseConfig& noise, const DensityOf& density_of) {
  return 0.25 * (density_of(linear_x_of(noise, 0)) + density_of(linear_x_of(noise, 1)));
}

/// The same at a frequency, from nominal_psd().
[[nodiscard]] double differential_x_psd(const NoiseConfig& noise, double frequency_hz);

}  // namespace proofmass
