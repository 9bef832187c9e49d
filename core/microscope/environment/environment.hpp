#pragma once

#include <array>

#include "core/math/vector3.hpp"
#include "core/microscope/environment/environment_config.hpp"
#include "core/microscope/environment/environment_table.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"

namespace proofmass {

/// Non-gravitational accelerations of the satellite from outside. The name of a variable says the
/// frame of both vectors: `external_S`.
template <typename T>
struct ExternalAccelerationOf {
  Vector3<T> linear_m_s2;     ///< Γ_ext of the satellite's centre of mass.
  Vector3<T> angular_rad_s2;  ///< Ω̇ that external torques cause.
};
using ExternalAcceleration = ExternalAccelerationOf<double>;

/// The external accelerations at any time of a session: harmonic in the mean anomaly, or
/// interpolated linearly between the rows of a table ([Hardy2013] section 5.1).
class Environment {
 public:
  /// @param table           Validated rows if config.kind is `file`; must outlive the object.
  /// @param orbit_period_s  After which a table that is too short for a session repeats.
  Environment(const EnvironmentConfig& config, const EnvironmentTable& table,
              double orbit_period_s);

  /// The components are those in I if the environment is harmonic, and those in S if it comes from
  /// a file. SessionSignals turns the former into the satellite's frame in sessions that spin.
  ///
  /// @param time_s  From the session's start; negative while the loops settle.
  /// @param point   The orbit at that time.
  [[nodiscard]] ExternalAcceleration at(double time_s, const OrbitPoint& point) const;

  /// True if the environment is a table that ends before this time: it is then repeated every
  /// orbit, from its first orbit.
  [[nodiscard]] bool is_periodic(double end_s) const;

  /// Chooses between the whole table and its first orbit for a session that ends at `end_s`.
  void begin_session(double end_s) { periodic_ = is_periodic(end_s); }

 private:
  /// a₀ + a₁ cos M + b₁ sin M + a₂ cos 2M + b₂ sin 2M of one axis.
  struct Harmonic {
    double mean, cosine, sine, twice_cosine, twice_sine;
  };

  [[nodiscard]] ExternalAcceleration interpolate(double time_s) const;

  EnvironmentKind kind_;
  double scale_;
  double orbit_period_s_;
  bool periodic_ = true;
  std::array<Harmonic, 6> harmonics_{};  ///< Linear x, y, z, angular x, y, z.
  const EnvironmentTable* table_;
};

}  // namespace proofmass
