#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace proofmass {

/// Where the external accelerations come from.
enum class EnvironmentKind : std::uint8_t {
  harmonic = 1,  ///< The HarmonicAxis of each axis, fixed in the inertial frame I.
  file = 2,      ///< The rows of a file, in the satellite frame S.
};

/// Spelling of an enumerator in campaign files; the list of all of them, in value order from 1.
[[nodiscard]] std::span<const std::string_view> names_of(EnvironmentKind);

/// mean + a₁ cos(n t + φ₁) + a₂ cos(2 n t + φ₂), t from perigee, n the mean motion. The unit of the
/// levels is that of the axis: m/s² or rad/s².
struct HarmonicAxis {
  double mean = 0.0;
  double orbital = 0.0;  ///< a₁ ≥ 0.
  double orbital_phase_rad = 0.0;
  double twice_orbital = 0.0;  ///< a₂ ≥ 0.
  double twice_orbital_phase_rad = 0.0;
};

/// Settings of Environment: `[environment]` of a campaign file.
struct EnvironmentConfig {
  EnvironmentKind kind = EnvironmentKind::harmonic;
  double scale = 1.0;  ///< Multiplies every external acceleration of either kind; 0 is off.
  HarmonicAxis linear_x, linear_y, linear_z;     ///< m/s².
  HarmonicAxis angular_x, angular_y, angular_z;  ///< rad/s².

  EnvironmentConfig();  ///< The nominal harmonic environment, see README.md.
};

}  // namespace proofmass
