#pragma once

#include <cmath>
#include <numbers>
#include <optional>

#include "core/math/elementary.hpp"
#include "core/math/inline.hpp"

namespace proofmass {

/// The orbit of the satellite about the Earth: `[orbit]` of a campaign file.
struct OrbitConfig {
  double period_s = 5950.0;
  double eccentricity = 5e-3;  ///< In [0, 0.5].
};

/// Where the satellite is on its orbit. The orbital plane is that of X and Z of the inertial frame
/// I: X points towards perigee, Z a quarter of a turn on.
template <typename T>
struct OrbitPointOf {
  T radial_I_x;  ///< û = (cos ν, 0, sin ν): unit vector from the Earth's centre to the satellite.
  T radial_I_z;
  T gradient_s2;                 ///< μ/r³.
  SineCosineOf<T> mean_anomaly;  ///< Of n·t.
};
using OrbitPoint = OrbitPointOf<double>;

/// True if a step of Newton's method, rad, is the last one: what it leaves is of the order of its
/// square, 1e-16.
PROOFMASS_INLINE bool is_small(double move) { return std::abs(move) < 1e-8; }

/// Keplerian motion with perigee on +X at t = 0. README.md has the equations and their range.
class KeplerOrbit {
 public:
  explicit KeplerOrbit(const OrbitConfig& config);

  /// A pure function of time, by Newton's method to rounding; `time_s` may be negative.
  [[nodiscard]] OrbitPoint at(double time_s) const;

  /// at() for a batch of times, one a lane; nothing if one of them needs more than the first
  /// step of Newton's method, which none does up to an eccentricity of 0.008.
  template <typename T>
  [[nodiscard]] PROOFMASS_INLINE std::optional<OrbitPointOf<T>> at_lanes(const T& time_s) const {
    const Newton<T> newton = first_step(time_s);
    if (!is_small(newton.move)) return std::nullopt;
    return last_step(newton);
  }

  [[nodiscard]] double period_s() const { return period_s_; }
  /// p = a (1 − e²), m, of an orbit about the Earth: r = p/(1 + e cos ν).
  [[nodiscard]] double semi_latus_rectum_m() const;
  [[nodiscard]] double eccentricity() const { return eccentricity_; }
  /// n = 2π/period, rad/s; n² = μ/a³.
  [[nodiscard]] double mean_motion_rad_s() const { return mean_motion_rad_s_; }

 private:
  /// Newton's method for the offset E − M of Kepler's equation E − e sin E = M.
  template <typename T>
  struct Newton {
    T turns;                    ///< M/2π.
    T offset, move;             ///< The next offset is offset − move.
    SineCosineOf<T> mean;       ///< Of M.
    SineCosineOf<T> eccentric;  ///< Of M + offset.
  };

  /// From the offset's third-order series in e; at e = 0.005 that is all it takes.
  template <typename T>
  PROOFMASS_INLINE Newton<T> first_step(const T& time_s) const {
    Newton<T> newton;
    newton.turns = time_s / T(period_s_);
    newton.mean = sincos_turns(newton.turns);
    const auto& [sine, cosine] = newton.mean;
    const T e = T(eccentricity_);
    newton.offset =
        e * sine * (T(1.0) + e * (cosine + e * (cosine * cosine - T(0.5) * sine * sine)));
    step(newton);
    return newton;
  }

  template <typename T>
  PROOFMASS_INLINE void step(Newton<T>& newton) const {
    const T e = T(eccentricity_);
    newton.eccentric = sincos_turns(newton.turns + newton.offset / T(2.0 * std::numbers::pi));
    const T residual = newton.offset - e * newton.eccentric.sine;
    newton.move = residual / (T(1.0) - e * newton.eccentric.cosine);
  }

  /// Turns by a small `move` at first order: that is off by about move², and the offset after the
  /// move by e·move².
  template <typename T>
  PROOFMASS_INLINE OrbitPointOf<T> last_step(const Newton<T>& newton) const {
    const auto& [old_sine, old_cosine] = newton.eccentric;
    const T sine = old_sine - newton.move * old_cosine;
    const T cosine = old_cosine + newton.move * old_sine;
    const T e = T(eccentricity_);
    const T radius_ratio = T(1.0) - e * cosine;  // r/a
    const T inverse = T(1.0) / radius_ratio;
    return {.radial_I_x = (cosine - e) * inverse,
            .radial_I_z = T(minor_ratio_) * sine * inverse,
            .gradient_s2 = T(mean_motion_rad_s_ * mean_motion_rad_s_) * inverse * inverse * inverse,
            .mean_anomaly = newton.mean};
  }

  double period_s_;
  double eccentricity_;
  double minor_ratio_;  ///< √(1 − e²).
  double mean_motion_rad_s_;
};

}  // namespace proofmass
