#include "core/microscope/instrument/noise_config.hpp"

#include <array>
#include <cmath>
#include <numbers>

namespace proofmass {

std::span<const std::string_view> names_of(NoisePreset) {
  static constexpr std::array<std::string_view, 4> names{"design_2013", "flight_suref",
                                                         "wire_suref", "wire_suep"};
  return names;
}

NoiseConfig::NoiseConfig()
    : linear_x{1.4e-12, 2.7e-4, 1.4e-12, 0.03, 0.0},
      linear_yz{7e-12, 2.7e-4, 1.4e-12, 0.03, 0.0},
      angular{2e-10, 1e-3, 0.0, 0.03, 0.0} {}

NoiseConfig noise_preset(NoisePreset preset) {
  NoiseConfig noise;
  noise.preset = preset;
  if (preset != NoisePreset::design_2013) {
    // Fit to the in-flight spectrum of SUREF, session 380, from 0.1 mHz to 0.1 Hz. Y and Z are not
    // published: they keep the ratio of the design to X.
    noise.linear_x = {4.49e-12, 7.33e-3, 4.49e-12, 0.01846, 0.0596};
    noise.linear_yz = {2.245e-11, 7.33e-3, 4.49e-12, 0.01846, 0.0596};
  }
  // The levels of SUEP's white part and rise are not published. Its wires are 16 times as lossy.
  if (preset == NoisePreset::wire_suref) {
    noise.linear_x.pink_corner_hz = 0.0;
    noise.wire = {.damping_n_m = 7e-5, .mass_kg = {0.401533, 1.359813}};
  } else if (preset == NoisePreset::wire_suep) {
    noise.linear_x.pink_corner_hz = 0.0;
    noise.wire = {.damping_n_m = 1.1e-3, .mass_kg = {0.401706, 0.300939}};
  }
  return noise;
}

SensorNoise linear_yz_of(const NoiseConfig& noise, std::size_t sensor) {
  SensorNoise of = noise.linear_yz;
  of.white_asd *= noise.linear_factor[sensor];
  of.rise_asd *= noise.linear_factor[sensor];
  return of;
}

namespace {

/// Density times frequency of the noise along X that the wire of a sensor makes, (m/s²)². By the
/// fluctuation-dissipation theorem for structural damping, one-sided and for each sensor,
///
///     S(f) = factor² 4 k_B T (k/Q)/(2π f m²)      (m/s²)²/Hz
///
/// @param sensor  0 or 1.
double wire_noise_level(const WireConfig& wire, std::size_t sensor) {
  constexpr double boltzmann_j_k = 1.380649e-23;
  const double amplitude = wire.factor[sensor] / wire.mass_kg[sensor];
  return amplitude * amplitude * 4.0 * boltzmann_j_k * wire.temperature_k * wire.damping_n_m /
         (2.0 * std::numbers::pi);
}

}  // namespace

SensorNoise linear_x_of(const NoiseConfig& noise, std::size_t sensor) {
  SensorNoise of = noise.linear_x;
  of.white_asd *= noise.linear_factor[sensor];
  of.rise_asd *= noise.linear_factor[sensor];
  of.pink_corner_hz += wire_noise_level(noise.wire, sensor) / (of.white_asd * of.white_asd);
  return of;
}

// Densities of both have one shape, so that their mean has it, too.
SensorNoise mean_linear_x(const NoiseConfig& noise) {
  const SensorNoise first = linear_x_of(noise, 0), second = linear_x_of(noise, 1);
  const auto mean_of_squares = [](double a, double b) { return 0.5 * (a * a + b * b); };
  const double white = mean_of_squares(first.white_asd, second.white_asd);
  SensorNoise mean = first;
  mean.white_asd = std::sqrt(white);
  mean.rise_asd = std::sqrt(mean_of_squares(first.rise_asd, second.rise_asd));
  mean.pink_corner_hz = 0.5 / white *
                        (first.white_asd * first.white_asd * first.pink_corner_hz +
                         second.white_asd * second.white_asd * second.pink_corner_hz);
  return mean;
}

double differential_x_psd(const NoiseConfig& noise, double frequency_hz) {
  return differential_x_density(noise,
                                [&](const SensorNoise& x) { return nominal_psd(x, frequency_hz); });
}

}  // namespace proofmass
