#pragma once

#include <array>
#include <cstddef>

namespace proofmass {

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

/// Density times frequency of the noise along X that the wire of a sensor makes, (m/s²)². By the
/// fluctuation-dissipation theorem for structural damping, one-sided and for each sensor,
///
///     S(f) = factor² 4 k_B T (k/Q)/(2π f m²)      (m/s²)²/Hz
///
/// @param sensor  0 or 1.
[[nodiscard]] double wire_noise_level(const WireConfig& wire, std::size_t sensor);

}  // namespace proofmass
