#include "core/orbit/kepler_orbit.hpp"

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
  constexpr double two_pi = 2.0 * std::numbers::pi;
  const double e = eccentricity_;
  const double turns = time_s / period_s_;
  const auto [mean_sine, mean_cosine] = sincos_turns(turns);

  // Kepler's equation E − e sin E = M for the offset E − M by Newton's method, from its third-order
  // series in e; at e = 0.005 one step reaches rounding.
  double offset =
      e * mean_sine *
      (1.0 + e * (mean_cosine + e * (mean_cosine * mean_cosine - 0.5 * mean_sine * mean_sine)));
  SineCosine eccentric = sincos_turns(turns + offset / two_pi);
  for (int step = 0; step < 20; ++step) {
    const double residual = offset - e * eccentric.sine;
    const double move = residual / (1.0 - e * eccentric.cosine);
    offset -= move;
    if (std::abs(move) < 1e-8) {
      // The next error would be about e·move², and so would be that of turning by −move at first
      // order.
      eccentric = {eccentric.sine - move * eccentric.cosine,
                   eccentric.cosine + move * eccentric.sine};
      break;
    }
    eccentric = sincos_turns(turns + offset / two_pi);
  }
  const double radius_ratio = 1.0 - e * eccentric.cosine;  // r/a
  const double inverse = 1.0 / radius_ratio;
  return {.direction_x = (eccentric.cosine - e) * inverse,
          .direction_z = minor_ratio_ * eccentric.sine * inverse,
          .gradient_s2 = mean_motion_rad_s_ * mean_motion_rad_s_ * inverse * inverse * inverse,
          .mean_anomaly_sine = mean_sine,
          .mean_anomaly_cosine = mean_cosine};
}

}  // namespace proofmass
