#include "core/microscope/environment/physical_environment.hpp"

#include <cmath>

#include "core/math/elementary.hpp"

namespace proofmass {
namespace {

constexpr double earth_rate_rad_s = 7.292115e-5;  // [WGS84]

/// Σ Aⱼ |vⱼ|: for a unit vector the area that is seen along it.
double area_along(const SatelliteBox& box, const Vector3<double>& v_F) {
  const Vector3<double>& size = box.size_m;
  return size.y * size.z * std::abs(v_F.x) + size.z * size.x * std::abs(v_F.y) +
         size.x * size.y * std::abs(v_F.z);
}

}  // namespace

double perigee_altitude_m(const OrbitConfig& orbit) {
  return KeplerOrbit(orbit).semi_latus_rectum_m() / (1.0 + orbit.eccentricity) - earth_radius_m;
}

Vector3<double> orbital_velocity(const KeplerOrbit& orbit, const OrbitPoint& point) {
  const double e = orbit.eccentricity();
  const double square = 1.0 - e * e;
  const double speed = orbit.mean_motion_rad_s() * orbit.semi_latus_rectum_m() /
                       (square * std::sqrt(square));  // √(μ/p)
  return {-speed * point.radial_I_z, 0.0, speed * (e + point.radial_I_x)};
}

Vector3<double> sun_direction(const Sunlight& sun) {
  const SineCosine beta = sincos(sun.beta_rad);
  const SineCosine phase = sincos(sun.phase_rad);
  return {beta.cosine * phase.cosine, -beta.sine, beta.cosine * phase.sine};
}

Vector3<double> earth_axis(const OrbitalPlane& plane) {
  const SineCosine inclination = sincos(plane.inclination_rad);
  const SineCosine perigee = sincos(plane.perigee_argument_rad);
  return {inclination.sine * perigee.sine, -inclination.cosine, inclination.sine * perigee.cosine};
}

Vector3<double> turned_about(const Vector3<double>& axis, double angle_rad,
                             const Vector3<double>& direction) {
  const SineCosine angle = sincos(angle_rad);
  return angle.cosine * direction + angle.sine * cross(axis, direction) +
         ((1.0 - angle.cosine) * dot(axis, direction)) * axis;
}

double air_density(const Atmosphere& atmosphere, double altitude_m, double bulge_cosine) {
  const double height = (altitude_m - atmosphere.reference_altitude_m) / atmosphere.scale_height_m;
  const double half = 0.5 + 0.5 * bulge_cosine;  // cos²(ψ/2)
  // Further up there is no air, and exponential() has an end.
  return atmosphere.night_density_kg_m3 * exponential(-std::fmin(height, 600.0)) *
         (1.0 + (atmosphere.bulge_ratio - 1.0) * half * half * half);
}

Vector3<double> drag_force(const SatelliteBox& box, double density_kg_m3,
                           const Vector3<double>& velocity_F) {
  const double flow = area_along(box, velocity_F);  // A |v|
  return (-0.5 * density_kg_m3 * box.drag_coefficient * flow) * velocity_F;
}

Vector3<double> radiation_force(const SatelliteBox& box, double pressure_pa,
                                const Vector3<double>& source_F) {
  const auto lit = [](double cosine) { return std::abs(cosine) * cosine; };
  const Vector3<double>& size = box.size_m;
  const Vector3<double> mirrored{size.y * size.z * lit(source_F.x),
                                 size.z * size.x * lit(source_F.y),
                                 size.x * size.y * lit(source_F.z)};
  const double absorbed = (1.0 - box.reflectivity) * area_along(box, source_F);
  return -pressure_pa * (absorbed * source_F + (2.0 * box.reflectivity) * mirrored);
}

bool is_lit(const Vector3<double>& position_F, const Vector3<double>& sun_F) {
  const double along = dot(position_F, sun_F);
  const double across_squared = dot(position_F, position_F) - along * along;
  return along >= 0.0 || across_squared >= earth_radius_m * earth_radius_m;
}

double earth_radiation_pressure(const EnvironmentPhysics& physics, double radius_m,
                                double zenith_cosine) {
  const double ratio = earth_radius_m / radius_m;
  const double infrared = 0.25 * (1.0 - physics.albedo);
  const double reflected = physics.albedo * std::fmax(0.0, zenith_cosine);
  return physics.sun.pressure_pa * (infrared + reflected) * ratio * ratio;
}

Vector3<double> gravity_torque(const SatelliteBox& box, double gradient_s2,
                               const Vector3<double>& radial_F) {
  return (3.0 * gradient_s2) * cross(radial_F, scaled(box.inertia_kg_m2, radial_F));
}

PhysicalEnvironment::PhysicalEnvironment(const EnvironmentPhysics& physics,
                                         const OrbitConfig& orbit)
    : physics_(physics),
      orbit_(orbit),
      sun_I_(sun_direction(physics.sun)),
      axis_I_(earth_axis(physics.plane)),
      bulge_I_(turned_about(axis_I_, physics.atmosphere.bulge_lag_rad, sun_I_)) {}

// The force acts at the centre of the box, whatever the faces are that it acts on: what a face has
// along the flow or the light adds up to a torque of 0 about that centre, and what it has along its
// normal passes through the axis of the box.
ExternalAcceleration PhysicalEnvironment::at(double time_s, double spin_rate_rad_s) const {
  const OrbitPoint point = orbit_.at(time_s);
  const Vector3<double> radial_I{point.radial_I_x, 0.0, point.radial_I_z};
  const double radius =
      orbit_.semi_latus_rectum_m() / (1.0 + orbit_.eccentricity() * point.radial_I_x);
  const Vector3<double> position_I = radius * radial_I;
  const Vector3<double> velocity_I =
      orbital_velocity(orbit_, point) - earth_rate_rad_s * cross(axis_I_, position_I);

  const SineCosine half = sincos(0.5 * spin_rate_rad_s * time_s);
  const Quaternion<double> attitude_IR{half.cosine, {0.0, half.sine, 0.0}};
  const auto in_R = [&](const Vector3<double>& v_I) { return to_target(attitude_IR, v_I); };
  const Vector3<double> radial_R = in_R(radial_I);

  const SatelliteBox& box = physics_.satellite;
  const double density =
      air_density(physics_.atmosphere, radius - earth_radius_m, dot(radial_I, bulge_I_));
  Vector3<double> force_R = drag_force(box, density, in_R(velocity_I));
  force_R += radiation_force(box, earth_radiation_pressure(physics_, radius, dot(radial_I, sun_I_)),
                             -radial_R);
  if (is_lit(position_I, sun_I_)) {
    force_R += radiation_force(box, physics_.sun.pressure_pa, in_R(sun_I_));
  }
  const Vector3<double> torque_R =
      cross(box.pressure_centre_m, force_R) + gravity_torque(box, point.gradient_s2, radial_R);
  const Vector3<double>& inertia = box.inertia_kg_m2;
  return {(1.0 / box.mass_kg) * force_R,
          {torque_R.x / inertia.x, torque_R.y / inertia.y, torque_R.z / inertia.z}};
}

namespace {

/// Whole numbers of rows before and from time 0 on.
struct RowCounts {
  double per_orbit, before, from_0;
};

RowCounts row_counts(const EnvironmentSpan& span, const OrbitConfig& orbit) {
  constexpr double in_orbit = 600.0, turn_rad = 0.1;
  const double turns = std::ceil(std::abs(span.spin_rate_rad_s) * orbit.period_s / turn_rad);
  const double per_orbit = std::fmax(in_orbit, turns);
  // The last row is one behind the end, so that rounding of its time leaves none out.
  if (span.spin_rate_rad_s == 0.0) return {per_orbit, 0.0, per_orbit + 2.0};
  return {per_orbit, std::ceil(span.settling_s * per_orbit / orbit.period_s),
          per_orbit * span.num_orbits + 2.0};
}

}  // namespace

double num_rows_of(const EnvironmentSpan& span, const OrbitConfig& orbit) {
  const RowCounts counts = row_counts(span, orbit);
  return counts.before + counts.from_0;
}

EnvironmentTable table_of(const PhysicalEnvironment& environment, const EnvironmentSpan& span,
                          const OrbitConfig& orbit) {
  const RowCounts counts = row_counts(span, orbit);
  EnvironmentTable table;
  for (double i = 0.0 - counts.before; i < counts.from_0; ++i) {
    const double time_s = i * orbit.period_s / counts.per_orbit;
    const auto [linear, angular] = environment.at(time_s, span.spin_rate_rad_s);
    table.push_back({.time_s = time_s,
                     .linear_m_s2 = {linear.x, linear.y, linear.z},
                     .angular_rad_s2 = {angular.x, angular.y, angular.z}});
  }
  return table;
}

}  // namespace proofmass
