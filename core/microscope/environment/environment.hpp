#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/math/vector3.hpp"
#include "core/microscope/environment/environment_table.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"

namespace proofmass {

enum class EnvironmentKind : std::uint8_t { harmonic = 1, file = 2 };

/// Spelling of an enumerator in campaign files; the list of all of them, in value order from 1.
[[nodiscard]] std::span<const std::string_view> names_of(EnvironmentKind);

/// mean + a₁ cos(n t + φ₁) + a₂ cos(2 n t + φ₂), t from perigee, n the mean motion.
struct HarmonicAxis {
  double mean = 0.0;
  double orbital = 0.0;
  double orbital_phase_rad = 0.0;
  double twice_orbital = 0.0;
  double twice_orbital_phase_rad = 0.0;
};

/// External acceleration of the satellite, in S: linear m/s², angular rad/s².
struct EnvironmentConfig {
  EnvironmentKind kind = EnvironmentKind::harmonic;
  double scale = 1.0;  ///< Multiplies every external acceleration; 0 switches them off.
  HarmonicAxis linear_x, linear_y, linear_z;
  HarmonicAxis angular_x, angular_y, angular_z;

  EnvironmentConfig();  ///< The nominal harmonic environment.
};

/// Non-gravitational accelerations of the satellite from outside, in S.
struct ExternalAcceleration {
  Vector3<double> linear_m_s2;
  Vector3<double> angular_rad_s2;
};

/// Harmonic in the mean anomaly, or interpolated linearly in a table ([Hardy2013] section 5.1).
class Environment {
 public:
  /// @param table  Validated rows if config.kind is `file`; must outlive the object.
  Environment(const EnvironmentConfig& config, const EnvironmentTable& table,
              double orbit_period_s);

  /// @param time_s  From the session's start; @param point  the orbit at that time.
  [[nodiscard]] ExternalAcceleration at(double time_s, const OrbitPoint& point) const;

  /// A table that does not reach this time is repeated every orbit, from its first orbit.
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
  std::array<Harmonic, 6> harmonics_{};
  const EnvironmentTable* table_;
};

}  // namespace proofmass
