#include "core/microscope/instrument/noise_config.hpp"

#include <array>

namespace proofmass {

std::span<const std::string_view> names_of(NoisePreset) {
  static constexpr std::array<std::string_view, 2> names{"design_2013", "flight_suref"};
  return names;
}

NoiseConfig::NoiseConfig()
    : linear_x{1.4e-12, 2.7e-4, 1.4e-12, 0.03, 0.0},
      linear_yz{7e-12, 2.7e-4, 1.4e-12, 0.03, 0.0},
      angular{2e-10, 1e-3, 0.0, 0.03, 0.0} {}

NoiseConfig noise_preset(NoisePreset preset) {
  NoiseConfig noise;
  noise.preset = preset;
  if (preset == NoisePreset::flight_suref) {
    // Fit to the in-flight spectrum of SUREF, session 380, from 0.1 mHz to 0.1 Hz. Y and Z are not
    // published: they keep the ratio of the design to X.
    noise.linear_x = {4.49e-12, 7.33e-3, 4.49e-12, 0.01846, 0.0596};
    noise.linear_yz = {2.245e-11, 7.33e-3, 4.49e-12, 0.01846, 0.0596};
  }
  return noise;
}

}  // namespace proofmass
