#pragma once

#include "core/campaign/scenario.hpp"

namespace proofmass {

/// Where the satellite is on its orbit, in the orbital plane of I (X towards perigee, Z a quarter
/// of a turn on).
struct OrbitPoint {
  double direction_x;  ///< û_I = (cos ν, 0, sin ν), from the Earth to the satellite.
  double direction_z;
  double gradient_s2;        ///< μ/r³.
  double mean_anomaly_sine;  ///< Of n·t.
  double mean_anomaly_cosine;
};

/// Keplerian motion with perigee on +X at t = 0.
class KeplerOrbit {
 public:
  explicit KeplerOrbit(const OrbitConfig& config);

  /// A pure function of time; `time_s` may be negative.
  [[nodiscard]] OrbitPoint at(double time_s) const;

  [[nodiscard]] double period_s() const { return period_s_; }
  /// n = 2π/period, rad/s; n² = μ/a³.
  [[nodiscard]] double mean_motion_rad_s() const { return mean_motion_rad_s_; }

 private:
  double period_s_;
  double eccentricity_;
  double minor_ratio_;  ///< √(1 − e²).
  double mean_motion_rad_s_;
};

}  // namespace proofmass
