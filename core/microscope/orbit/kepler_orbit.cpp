#include "core/microscope/orbit/kepler_orbit.hpp"

#include <cmath>
#include <numbers>

namespace proofmass {

KeplerOrbit::KeplerOrbit(const OrbitConfig& config)
    : period_s_(config.period_s),
      eccentricity_(config.eccentricity),
      minor_ratio_(std::sqrt(1.0 - config.eccentricity * config.eccentricity)),
      mean_motion_rad_s_(2.0 * std::numbers::pi / config.period_s) {}

OrbitPoint KeplerOrbit::at(double time_s) const {
  Newton<double> newton = first_step(time_s);
  for (int i = 0; i < 20 && !is_small(newton.move); ++i) {
    newton.offset -= newton.move;
    step(newton);
  }
  return last_step(newton);
}

}  // namespace proofmass
