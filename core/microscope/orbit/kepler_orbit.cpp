#include "core/microscope/orbit/kepler_orbit.hpp"

#include <cmath>
#include <numbers>

#include "core/math/elementary.hpp"

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

double KeplerOrbit::semi_latus_rectum_m() const {
  constexpr double earth_m3_s2 = 3.986004418e14;  // μ of the Earth, IERS Conventions (2010).
  const double cube = earth_m3_s2 / (mean_motion_rad_s_ * mean_motion_rad_s_);  // a³.
  return minor_ratio_ * minor_ratio_ * exponential(logarithm(cube) / 3.0);
}

}  // namespace proofmass
