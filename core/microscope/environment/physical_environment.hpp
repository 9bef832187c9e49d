#pragma once

#include "core/math/vector3.hpp"
#include "core/microscope/environment/environment.hpp"
#include "core/microscope/environment/environment_table.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"

namespace proofmass {

// The rows of an environment file from physics: drag, radiation pressure of the Sun and of the
// Earth, and the torque of the Earth's gravity. README.md has the sources of all nominal values and
// says what is left out. F is any one frame in which all arguments are given.

/// The satellite: a box whose faces are normal to the axes of S.
struct SatelliteBox {
  double mass_kg = 303.0;
  Vector3<double> size_m{1.38, 1.04, 1.58};
  Vector3<double> pressure_centre_m{0.02, 0.02, 0.02};  ///< Of the box, from the centre of mass.
  Vector3<double> inertia_kg_m2{90.0, 111.0, 75.0};     ///< Principal; their axes are those of S.
  double drag_coefficient = 2.3;                        ///< C_D.
  double reflectivity = 0.3;  ///< ε in [0, 1]: light that is reflected as by a mirror.
};

/// How the orbital plane lies to the Earth's axis, which air turns about.
struct OrbitalPlane {
  double inclination_rad = 1.71444;
  double perigee_argument_rad = 1.5708;  ///< From the ascending node to perigee.
};

/// The upper atmosphere.
struct Atmosphere {
  double reference_altitude_m = 700e3;
  double night_density_kg_m3 = 2.043e-14;  ///< ρ₀: at that altitude, opposite to the bulge.
  double scale_height_m = 88.667e3;        ///< H.
  double bulge_ratio = 10.7;               ///< b ≥ 1: density in the bulge over that at night.
  double bulge_lag_rad = 0.5236;           ///< Angle by which the bulge follows the Sun, eastwards.
};

/// The Sun, at rest in I.
struct Sunlight {
  double beta_rad = 1.4272;  ///< β: height above the orbital plane, on the side of r × v, −Y.
  double phase_rad = 0.0;    ///< From perigee to the Sun's projection on the plane, along v.
  double pressure_pa = 4.56e-6;  ///< P: what falls on a surface, over the speed of light.
};

/// All that the external accelerations follow from, beside the orbit: a file of settings. Numbers
/// alone.
struct EnvironmentPhysics {
  SatelliteBox satellite{};
  OrbitalPlane plane{};
  Atmosphere atmosphere{};
  Sunlight sun{};
  double albedo = 0.3;  ///< a in [0, 1]: sunlight that the Earth reflects.
};

inline constexpr double earth_radius_m = 6378137.0;  ///< R, equatorial [WGS84].

/// Height of the perigee above that radius.
[[nodiscard]] double perigee_altitude_m(const OrbitConfig& orbit);

/// v_I, m/s: n p (1 − e²)^(−3/2) (−sin ν, 0, e + cos ν).
[[nodiscard]] Vector3<double> orbital_velocity(const KeplerOrbit& orbit, const OrbitPoint& point);

/// Unit vector from the Earth to the Sun in I: (cos β cos φ, −sin β, cos β sin φ).
[[nodiscard]] Vector3<double> sun_direction(const Sunlight& sun);

/// Unit vector along the Earth's axis, northwards, in I: cos i on −Y, and sin i in the plane a
/// quarter of a turn from the ascending node.
[[nodiscard]] Vector3<double> earth_axis(const OrbitalPlane& plane);

/// `direction` turned about the unit vector `axis` by an angle, rad, right-handed; exact.
[[nodiscard]] Vector3<double> turned_about(const Vector3<double>& axis, double angle_rad,
                                           const Vector3<double>& direction);

/// Density of air, kg/m³: exponential in the altitude h, with a bulge as in [Montenbruck2000]
/// section 3.5.2 for the exponent 6 of polar orbits,
///
///     ρ = ρ₀ exp(−(h − h₀)/H) (1 + (b − 1) cos⁶(ψ/2))
///
/// Good for h within about H of h₀. Densities change by factors within a solar cycle.
///
/// @param bulge_cosine  cos ψ, ψ between the satellite and the middle of the bulge.
[[nodiscard]] double air_density(const Atmosphere& atmosphere, double altitude_m,
                                 double bulge_cosine);

/// Drag, N: −½ ρ C_D A |v| v with A the area of the box as seen along v. Free molecular flow, with
/// one coefficient whatever the angle of the faces.
///
/// @param velocity_F  v, of the satellite against the air, m/s.
[[nodiscard]] Vector3<double> drag_force(const SatelliteBox& box, double density_kg_m3,
                                         const Vector3<double>& velocity_F);

/// Force of parallel light, N, on the lit faces: each of area A whose normal n is θ away from the
/// source s has −P A cos θ ((1 − ε) s + 2 ε cos θ n) ([Montenbruck2000] section 3.4). What is
/// absorbed is not emitted again.
///
/// @param source_F  s, unit vector towards the source.
[[nodiscard]] Vector3<double> radiation_force(const SatelliteBox& box, double pressure_pa,
                                              const Vector3<double>& source_F);

/// False in the Earth's shadow, a cylinder of the Earth's radius: s·r < 0 and |r − (s·r)s| < R. The
/// penumbra, some 8 s wide in a low orbit, is left out.
///
/// @param position_F  r, from the Earth's centre, m.
/// @param sun_F       s, unit vector.
[[nodiscard]] bool is_lit(const Vector3<double>& position_F, const Vector3<double>& sun_F);

/// Pressure of the Earth's light, Pa, taken to be parallel and to come from below: infrared of an
/// Earth that emits evenly what it absorbs, and sunlight reflected by the ground below,
///
///     P ((1 − a)/4 + a max(0, cos ζ)) (R/r)²
///
/// At 710 km the infrared part is exact in its vertical force. The reflected part is off by less
/// than 0.03 a P, the most with the Sun at the horizon; a horizontal force of up to 0.055 a P is
/// left out.
///
/// @param radius_m       r.
/// @param zenith_cosine  cos ζ, ζ between the Sun and the vertical.
[[nodiscard]] double earth_radiation_pressure(const EnvironmentPhysics& physics, double radius_m,
                                              double zenith_cosine);

/// Torque of the Earth's gravity, N m: 3 (μ/r³) û ∧ [I] û. First order in size over distance.
[[nodiscard]] Vector3<double> gravity_torque(const SatelliteBox& box, double gradient_s2,
                                             const Vector3<double>& radial_F);

/// The external accelerations of a satellite on an orbit, in the frame R of a session: attitude
/// errors and commanded angles, some mrad, turn them no further.
class PhysicalEnvironment {
 public:
  PhysicalEnvironment(const EnvironmentPhysics& physics, const OrbitConfig& orbit);

  /// @param time_s           From perigee.
  /// @param spin_rate_rad_s  Of R against I, about Y; R and I agree at time 0.
  [[nodiscard]] ExternalAcceleration at(double time_s, double spin_rate_rad_s) const;

 private:
  EnvironmentPhysics physics_;
  KeplerOrbit orbit_;
  Vector3<double> sun_I_, axis_I_, bulge_I_;
};

/// The time that a file has to cover, in an attitude.
struct EnvironmentSpan {
  double spin_rate_rad_s = 0.0;
  double settling_s = 0.0;  ///< Before a session.
  int num_orbits = 1;       ///< Of the longest session.
};

/// Rows that table_of() makes.
[[nodiscard]] double num_rows_of(const EnvironmentSpan& span, const OrbitConfig& orbit);

/// Rows of an environment file. In inertial pointing they are those of one orbit, which repeats;
/// with a spin those of a whole session and of the time before it, because its attitudes need not.
/// An orbit has 600 rows or, with a spin, one for each 0.1 rad: linear interpolation then weakens a
/// line at k times the spin rate by (0.1 k)²/12.
[[nodiscard]] EnvironmentTable table_of(const PhysicalEnvironment& environment,
                                        const EnvironmentSpan& span, const OrbitConfig& orbit);

}  // namespace proofmass
