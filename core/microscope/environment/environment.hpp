#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/campaign/definition.hpp"
#include "core/campaign/run_result.hpp"
#include "core/math/vector3.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"

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

/// Non-gravitational accelerations of the satellite from outside. The name of a variable says the
/// frame of both vectors: `external_S`.
template <typename T>
struct ExternalAccelerationOf {
  Vector3<T> linear_m_s2;     ///< Γ_ext of the satellite's centre of mass.
  Vector3<T> angular_rad_s2;  ///< Ω̇ that external torques cause.
};
using ExternalAcceleration = ExternalAccelerationOf<double>;

/// A row of an environment file, whose columns the fields are named after. In S.
struct EnvironmentRow {
  double time_s = 0.0;                     ///< From perigee.
  std::array<double, 3> linear_m_s2{};     ///< x, y, z.
  std::array<double, 3> angular_rad_s2{};  ///< x, y, z.

  bool operator==(const EnvironmentRow&) const = default;
};

/// Rows of an environment file, times ascending.
using EnvironmentTable = std::vector<EnvironmentRow>;

/// Most rows that a table may have: 40 orbits every 10 s have 24,000.
inline constexpr std::size_t environment_rows_max = 200'000;

/// Checks that the table has 2 to environment_rows_max rows, that every value is finite, that times
/// ascend, that the first is at most 0 and the last at least one orbit.
/// @throws ConfigError naming `environment.file row i`, i from 1.
void validate_environment_table(const EnvironmentTable& table, double orbit_period_s);

/// Key, columns and meaning of the table by which a Definition carries the rows.
[[nodiscard]] DataTableSchema environment_table_schema();

/// The rows as that table; no table if there are no rows.
[[nodiscard]] std::vector<DataTable> tables_of(const EnvironmentTable& environment);

/// The rows of those tables. Their values may be any numbers: validate_environment_table() checks
/// them.
/// @throws DefinitionError unless there is no table, or one of the right key and shape.
[[nodiscard]] EnvironmentTable environment_of(const std::vector<DataTable>& tables);

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
