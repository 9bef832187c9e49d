#include "core/microscope/environment/physical_environment.hpp"

#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

const OrbitConfig circular{.period_s = 5950.0, .eccentricity = 0.0};
const OrbitConfig elliptic{.period_s = 5950.0, .eccentricity = 0.3};

double norm(const Vector3<double>& v) { return std::sqrt(dot(v, v)); }

void expect_vector(const Vector3<double>& actual, const Vector3<double>& expected,
                   double tolerance) {
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(actual[i], expected[i], tolerance) << "axis " << i;
  }
}

Vector3<double> position(const KeplerOrbit& orbit, double time_s) {
  const OrbitPoint point = orbit.at(time_s);
  const double radius =
      orbit.semi_latus_rectum_m() / (1.0 + orbit.eccentricity() * point.radial_I_x);
  return radius * Vector3<double>{point.radial_I_x, 0.0, point.radial_I_z};
}

// A central difference over 2 s leaves (n s)²/6, 2e-7, of the velocity at e = 0, and a hundred
// times that near the perigee of this orbit.
TEST(OrbitalVelocity, IsTheRateOfThePosition) {
  const KeplerOrbit orbit(elliptic);
  for (double t = 0.0; t < 5950.0; t += 321.0) {
    const Vector3<double> rate = 0.5 * (position(orbit, t + 1.0) - position(orbit, t - 1.0));
    const Vector3<double> velocity = orbital_velocity(orbit, orbit.at(t));
    EXPECT_LT(norm(velocity - rate), 2e-5 * norm(velocity)) << t;
  }
}

// At an argument of latitude u the latitude is asin(sin i sin u); eastwards is the side to which a
// satellite with i < 90° flies at its ascending node.
TEST(EarthAxis, GivesTheLatitude) {
  const OrbitalPlane plane{.inclination_rad = 1.2, .perigee_argument_rad = 0.7};
  const Vector3<double> axis = earth_axis(plane);
  EXPECT_NEAR(norm(axis), 1.0, 1e-15);
  for (double u = 0.0; u < 6.0; u += 0.5) {
    const double anomaly = u - plane.perigee_argument_rad;
    const Vector3<double> radial{std::cos(anomaly), 0.0, std::sin(anomaly)};
    EXPECT_NEAR(dot(axis, radial), std::sin(plane.inclination_rad) * std::sin(u), 1e-15);
  }
  const KeplerOrbit orbit(circular);
  const Vector3<double> momentum =
      cross(position(orbit, 100.0), orbital_velocity(orbit, orbit.at(100.0)));
  EXPECT_NEAR(dot(axis, momentum), std::cos(plane.inclination_rad) * norm(momentum),
              1e-12 * norm(momentum));
}

// In the Earth's equator, with the Sun above the meridian of X, the node of 18 h is on Y; the
// perigee is a quarter of a turn after it. The rules are those of deploy/campaigns/physics.toml.
TEST(SunDirection, IsThatOfItsDeclination) {
  const double i = OrbitalPlane{}.inclination_rad, half_turn = std::numbers::pi;
  for (double declination = -0.409; declination < 0.41; declination += 0.0409) {
    const Vector3<double> sun{std::cos(declination), 0.0, std::sin(declination)};
    const Vector3<double> perigee{-std::cos(i), 0.0, std::sin(i)};
    const Vector3<double> normal{std::sin(i), 0.0, std::cos(i)};
    const Sunlight set{.beta_rad = std::asin(std::sin(i + declination)),
                       .phase_rad = i + declination > 0.5 * half_turn ? 0.0 : half_turn};
    expect_vector(sun_direction(set), {dot(sun, perigee), -dot(sun, normal), 0.0}, 1e-12);
  }
}

TEST(SunDirection, HasItsHeightOverTheOrbitalPlane) {
  const Vector3<double> sun = sun_direction({.beta_rad = 0.4, .phase_rad = 2.0});
  const KeplerOrbit orbit(circular);
  const Vector3<double> momentum =
      cross(position(orbit, 0.0), orbital_velocity(orbit, orbit.at(0.0)));
  EXPECT_NEAR(dot(sun, momentum) / norm(momentum), std::sin(0.4), 1e-14);
  // 2 rad after perigee the Sun is as high as it gets.
  EXPECT_NEAR(dot(sun, {std::cos(2.0), 0.0, std::sin(2.0)}), std::cos(0.4), 1e-15);
}

// At an equinox, with the ascending node a quarter of a turn east of the Sun, the Sun is β away
// from the plane and 90° after the ascending node: at perigee if that is there.
TEST(SunDirection, IsNominallyThatOfAnEquinoxAtDusk) {
  const EnvironmentPhysics nominal;
  const Vector3<double> sun = sun_direction(nominal.sun);
  EXPECT_NEAR(dot(sun, earth_axis(nominal.plane)), 0.0, 1e-4);  // Its declination.
  EXPECT_NEAR(nominal.sun.beta_rad, pi - nominal.plane.inclination_rad, 1e-4);
}

TEST(TurnedAbout, FollowsTheRightHand) {
  expect_vector(turned_about({0.0, 0.0, 1.0}, pi / 6, {1.0, 0.0, 5.0}), {std::sqrt(0.75), 0.5, 5.0},
                1e-15);
}

// [Montenbruck2000] table 3.8: 2.043e-14 and 2.185e-13 kg/m³ at 700 km, 1.607e-14 and 1.779e-13 at
// 720 km. One scale height for both is off by 2 %.
TEST(AirDensity, IsThatOfTheTable) {
  const Atmosphere nominal;
  EXPECT_NEAR(air_density(nominal, 700e3, -1.0), 2.043e-14, 1e-20);
  EXPECT_NEAR(air_density(nominal, 700e3, 1.0), 2.185e-13, 0.01 * 2.185e-13);
  EXPECT_NEAR(air_density(nominal, 720e3, -1.0), 1.607e-14, 0.02 * 1.607e-14);
  EXPECT_NEAR(air_density(nominal, 720e3, 1.0), 1.779e-13, 0.02 * 1.779e-13);
}

// A quarter of a turn from the bulge cos⁶(45°) = ⅛; one scale height further up there is 1/e.
TEST(AirDensity, HasABulgeOfSomeRatioAtEveryAltitude) {
  const Atmosphere air{.reference_altitude_m = 500e3,
                       .night_density_kg_m3 = 1e-12,
                       .scale_height_m = 60e3,
                       .bulge_ratio = 5.0};
  EXPECT_NEAR(air_density(air, 500e3, 0.0), 1.5e-12, 1e-26);
  for (const double altitude_m : {450e3, 500e3, 560e3}) {
    const double night = air_density(air, altitude_m, -1.0);
    EXPECT_NEAR(air_density(air, altitude_m, 1.0) / night, 5.0, 1e-13);
    EXPECT_NEAR(air_density(air, altitude_m + 60e3, -1.0) / night, std::exp(-1.0), 1e-14);
  }
  EXPECT_LT(air_density(air, 1e9, 1.0), 1e-200);  // No error where there is no air.
}

// By hand: ½ · 1e-13 · 2.3 · (1.04 · 1.58) · 7500² = 1.063e-5 N.
TEST(DragForce, IsThatOfTheFaceInTheFlow) {
  expect_vector(drag_force({}, 1e-13, {7500.0, 0.0, 0.0}), {-1.063e-5, 0.0, 0.0}, 1e-8);
  expect_vector(drag_force({}, 1e-13, {0.0, 0.0, -7500.0}), {0.0, 0.0, 9.284e-6}, 1e-8);
}

// From 45° two faces show 1/√2 of their areas, and the force is still along the flow.
TEST(DragForce, OfATurnedBoxIsAlongTheFlow) {
  const SatelliteBox cube{.size_m = {2.0, 2.0, 2.0}, .drag_coefficient = 2.0};
  const double force = 1e-12 * 7000.0 * 7000.0 * 4.0 * std::sqrt(2.0);
  const double side = 7000.0 / std::sqrt(2.0);
  expect_vector(drag_force(cube, 1e-12, {side, side, 0.0}),
                {-force / std::sqrt(2.0), -force / std::sqrt(2.0), 0.0}, 1e-12 * force);
}

/// 1 m², normal to X.
SatelliteBox plate(double reflectivity) {
  return {.size_m = {0.0, 1.0, 1.0}, .reflectivity = reflectivity};
}

// 1361 W/m² at 1 AU, over the speed of light: 4.54e-6 N on a black plate, twice that on a mirror.
// At 60° a black plate takes half of the light along with its direction, and a mirror half of half
// of the double force along its normal.
TEST(RadiationForce, IsThatOfAPlateAtOneAstronomicalUnit) {
  const double pressure = Sunlight().pressure_pa;
  const double expected = 1361.0 / 299792458.0;
  const Vector3<double> ahead{1.0, 0.0, 0.0};
  const Vector3<double> slanted{0.5, std::sqrt(0.75), 0.0};
  const double tolerance = 0.01 * expected;
  expect_vector(radiation_force(plate(0.0), pressure, ahead), -expected * ahead, tolerance);
  expect_vector(radiation_force(plate(1.0), pressure, ahead), -2.0 * expected * ahead, tolerance);
  expect_vector(radiation_force(plate(0.0), pressure, slanted), -0.5 * expected * slanted,
                tolerance);
  expect_vector(radiation_force(plate(1.0), pressure, -slanted), 0.5 * expected * ahead, tolerance);
  expect_vector(radiation_force(plate(0.4), pressure, slanted),
                -0.5 * expected * (0.6 * slanted + 0.4 * ahead), tolerance);
}

// In a circular orbit the shadow is α to both sides of the point opposite to the Sun, with
// cos α = √(1 − (R/r)²)/cos β.
TEST(Shadow, BeginsAndEndsWhenGeometrySays) {
  const KeplerOrbit orbit(circular);
  const Sunlight sun{.beta_rad = 0.6, .phase_rad = 1.1};
  const Vector3<double> sun_I = sun_direction(sun);
  const double ratio = earth_radius_m / orbit.semi_latus_rectum_m();
  const double half = std::acos(std::sqrt(1.0 - ratio * ratio) / std::cos(sun.beta_rad));
  const double rate = orbit.mean_motion_rad_s();
  const double entry_s = (sun.phase_rad + pi - half) / rate;
  const double exit_s = (sun.phase_rad + pi + half) / rate;
  ASSERT_GT(exit_s - entry_s, 1500.0);
  for (const double t : {1e-3, 10.0, 700.0}) {
    EXPECT_TRUE(is_lit(position(orbit, entry_s - t), sun_I)) << t;
    EXPECT_FALSE(is_lit(position(orbit, entry_s + t), sun_I)) << t;
    EXPECT_FALSE(is_lit(position(orbit, exit_s - t), sun_I)) << t;
    EXPECT_TRUE(is_lit(position(orbit, exit_s + t), sun_I)) << t;
  }
}

// Above β = asin(R/r), 1.117 rad here, there is none.
TEST(Shadow, IsMissedIfTheSunIsHighOverThePlane) {
  const KeplerOrbit orbit(circular);
  const auto num_dark = [&](double beta) {
    int count = 0;
    for (int i = 0; i < 5950; ++i) {
      count += is_lit(position(orbit, i), sun_direction({.beta_rad = beta})) ? 0 : 1;
    }
    return count;
  };
  const double limit = std::asin(earth_radius_m / orbit.semi_latus_rectum_m());
  EXPECT_EQ(num_dark(limit + 1e-3), 0);
  EXPECT_GT(num_dark(limit - 1e-3), 50);
}

// An Earth that absorbs 0.7 of 1361 W/m² emits 238 W/m²: 6.4e-7 Pa at 710 km. Below the Sun 0.3 of
// the light comes back.
TEST(EarthRadiation, IsThatOfThermalBalance) {
  const double radius = earth_radius_m + 710e3;
  const double square = std::pow(6378.1 / 7088.1, 2);
  const double infrared = 238.2 / 299792458.0 * square;
  const double reflected = 0.3 * 1361.0 / 299792458.0 * square;
  EXPECT_NEAR(infrared, 6.43e-7, 1e-9);
  EXPECT_NEAR(earth_radiation_pressure({}, radius, -0.5), infrared, 0.01 * infrared);
  EXPECT_NEAR(earth_radiation_pressure({}, radius, 1.0), infrared + reflected,
              0.01 * (infrared + reflected));
}

/// Force on a black sphere of 1 m² from a sphere whose ground, as seen from above, shines with
/// `brightness` times 1/π: upwards and, away from the Sun, sideways.
template <typename Brightness>
Vector3<double> light_of_earth(double radius_m, const Brightness& brightness) {
  constexpr int num_rings = 200, num_parts = 200;
  const double horizon = std::acos(earth_radius_m / radius_m);
  Vector3<double> sum;
  for (int i = 0; i < num_rings; ++i) {
    const double polar = (i + 0.5) * horizon / num_rings;
    for (int j = 0; j < num_parts; ++j) {
      const double turn = 2.0 * pi * j / num_parts;
      const Vector3<double> ground{std::sin(polar) * std::cos(turn),
                                   std::sin(polar) * std::sin(turn), std::cos(polar)};
      const Vector3<double> ray = Vector3<double>{0.0, 0.0, radius_m} - earth_radius_m * ground;
      const double cosine = dot(ray, ground) / norm(ray);
      const double area = earth_radius_m * earth_radius_m * std::sin(polar) * horizon / num_rings *
                          2.0 * pi / num_parts;
      sum += (brightness(ground) * area * std::fmax(0.0, cosine) / (pi * std::pow(norm(ray), 3))) *
             ray;
    }
  }
  return sum;
}

// The docstring's errors, against an integral over the ground that the satellite sees.
TEST(EarthRadiation, IsAsGoodAsItSays) {
  const double radius = earth_radius_m + 710e3;
  const EnvironmentPhysics dark{.sun = {.pressure_pa = 4.0}, .albedo = 0.0};
  const EnvironmentPhysics white{.sun = {.pressure_pa = 1.0}, .albedo = 1.0};
  const Vector3<double> infrared =
      light_of_earth(radius, [](const Vector3<double>&) { return 1.0; });
  EXPECT_NEAR(earth_radiation_pressure(dark, radius, 0.0), infrared.z, 1e-3 * infrared.z);
  for (double zenith = 0.0; zenith < pi; zenith += 0.1) {
    const Vector3<double> sun{std::sin(zenith), 0.0, std::cos(zenith)};
    const Vector3<double> reflected = light_of_earth(
        radius, [&](const Vector3<double>& ground) { return std::fmax(0.0, dot(ground, sun)); });
    EXPECT_NEAR(earth_radiation_pressure(white, radius, sun.z), reflected.z, 0.03) << zenith;
    EXPECT_LT(std::abs(reflected.x), 0.055) << zenith;
  }
}

// A dumbbell: the forces on two masses of 1 kg, 1 m to both sides of the centre of mass, from
// Newton's law. What is beyond first order is 1e-7.
TEST(GravityTorque, IsThatOfADumbbell) {
  const double gravity = 3.986e14, radius = 7.1e6;
  const Vector3<double> radial{0.6, 0.0, 0.8};
  const SatelliteBox dumbbell{.inertia_kg_m2 = {0.0, 2.0, 2.0}};
  Vector3<double> expected;
  for (const double side : {1.0, -1.0}) {
    const Vector3<double> arm{side, 0.0, 0.0};
    const Vector3<double> place = radius * radial + arm;
    expected += cross(arm, (-gravity / std::pow(norm(place), 3)) * place);
  }
  EXPECT_GT(std::abs(expected.y), 1e-7);
  expect_vector(gravity_torque(dumbbell, gravity / std::pow(radius, 3), radial), expected,
                1e-3 * std::abs(expected.y));
}

/// Sunlight alone, on a black box: no air, no infrared light, and none reflected at night.
EnvironmentPhysics sun_alone() {
  EnvironmentPhysics physics{.sun = {.beta_rad = 0.0}, .albedo = 1.0};
  physics.satellite.drag_coefficient = 0.0;
  physics.satellite.reflectivity = 0.0;
  return physics;
}

// The Sun is in perigee's direction. 100° after perigee it is below the horizon and not yet hidden.
// R has turned about Y by α, from X away from Z, so the Sun is at (cos α, 0, sin α) in R.
TEST(PhysicalEnvironment, TurnsWithTheSatellite) {
  const PhysicalEnvironment environment(sun_alone(), circular);
  const double time_s = 5950.0 * 100.0 / 360.0;
  for (const double angle : {0.0, 0.3, 2.0, -1.2, 40.0}) {
    const Vector3<double> force = environment.at(time_s, angle / time_s).linear_m_s2;
    const double seen =
        1.04 * (1.58 * std::abs(std::cos(angle)) + 1.38 * std::abs(std::sin(angle)));
    const double size = 4.56e-6 * seen / 303.0;
    expect_vector(force, {-size * std::cos(angle), 0.0, -size * std::sin(angle)}, 1e-12 * size);
  }
}

// By hand: 4.56e-6 · 1.04 · 1.58 N at (−1, 0, 0), 1 cm beside the centre of mass along Z, is
// −7.49e-8 N m about Y, and 1.5 · 2n² · (Ix − Iz) · sin 100° cos 100° comes on top.
TEST(PhysicalEnvironment, TurnsTheSatelliteByForceAndGravity) {
  EnvironmentPhysics physics = sun_alone();
  physics.satellite.pressure_centre_m = {0.0, 0.0, 0.01};
  const PhysicalEnvironment environment(physics, circular);
  const double anomaly = 100.0 / 180.0 * pi;
  const Vector3<double> angular = environment.at(5950.0 * 100.0 / 360.0, 0.0).angular_rad_s2;
  const double gravity =
      3.0 * std::pow(2.0 * pi / 5950.0, 2) * 15.0 * std::sin(anomaly) * std::cos(anomaly);
  expect_vector(angular, {0.0, (gravity - 7.493e-8) / 111.0, 0.0}, 1e-12);
}

// The Sun is on the −Y side: 4.56e-6 · 1.38 · 1.58 · 1.3/303 m/s², of which 2 % are missing as it
// is 8° from the axis.
TEST(PhysicalEnvironment, IsPushedAwayFromTheSun) {
  EXPECT_NEAR(PhysicalEnvironment({}, {}).at(1000.0, 0.0).linear_m_s2.y, 4.27e-8, 0.1e-8);
}

// Opposite to the Sun there is infrared light of the Earth alone: by hand ¼ · 4.56e-6 ·
// (6378/7097)² · 1.04 · 1.58 · 1.3/303 m/s² upwards, which is along −X.
TEST(PhysicalEnvironment, IsPushedUpwardsInTheShadow) {
  EnvironmentPhysics physics;
  physics.sun.beta_rad = 0.0;
  physics.albedo = 0.0;
  physics.satellite.drag_coefficient = 0.0;
  const Vector3<double> light = PhysicalEnvironment(physics, circular).at(2975.0, 0.0).linear_m_s2;
  expect_vector(light, {-6.49e-9, 0.0, 0.0}, 0.05e-9);
}

// Over an equatorial orbit a bulge 0.6 rad behind a Sun at 0.4 rad is 1 rad after perigee: drag
// there is that of the opposite side times the ratio.
TEST(PhysicalEnvironment, HasMoreDragInTheBulge) {
  EnvironmentPhysics physics;
  physics.plane.inclination_rad = 0.0;
  physics.atmosphere.bulge_lag_rad = 0.6;
  physics.sun = {.beta_rad = 0.0, .phase_rad = 0.4, .pressure_pa = 0.0};
  const PhysicalEnvironment environment(physics, circular);
  const double time_s = 5950.0 / (2.0 * pi);
  const Vector3<double> bulge = environment.at(time_s, 0.0).linear_m_s2;
  const Vector3<double> night = environment.at(time_s + 2975.0, 0.0).linear_m_s2;
  EXPECT_NEAR(norm(bulge) / norm(night), physics.atmosphere.bulge_ratio, 1e-9);
}

// Drag is opposite to the velocity against the air, which turns with the Earth: at the ascending
// node of a polar orbit the flow comes from the side by ω r = 0.52 km/s.
TEST(PhysicalEnvironment, DragsAgainstTurningAir) {
  EnvironmentPhysics physics;
  physics.plane = {.inclination_rad = pi / 2, .perigee_argument_rad = 0.0};
  physics.sun.pressure_pa = 0.0;
  const PhysicalEnvironment environment(physics, circular);
  const Vector3<double> drag = environment.at(0.0, 0.0).linear_m_s2;
  const KeplerOrbit orbit(circular);
  const double radius = orbit.semi_latus_rectum_m();
  const double speed = 2.0 * pi / 5950.0 * radius;
  EXPECT_NEAR(drag.x, 0.0, 1e-15 * std::abs(drag.z));
  EXPECT_LT(drag.z, 0.0);
  // The Earth's axis is along the velocity, Z; air moves along Z × X = Y.
  EXPECT_NEAR(drag.y / -drag.z, 7.292e-5 * radius / speed, 1e-4);
}

/// The largest distance of interpolated rows from what they were made of, over the largest value.
double interpolation_error(const PhysicalEnvironment& physical, const EnvironmentSpan& span,
                           double from_s, double to_s) {
  const OrbitConfig orbit;
  const KeplerOrbit kepler(orbit);
  const EnvironmentTable table = table_of(physical, span, orbit);
  EXPECT_EQ(static_cast<double>(table.size()), num_rows_of(span, orbit));
  EXPECT_NO_THROW(validate_environment_table(table, orbit.period_s));
  EnvironmentConfig config;
  config.kind = EnvironmentKind::file;
  Environment environment(config, table, orbit.period_s);
  environment.begin_session(to_s);
  double error = 0.0, largest = 0.0;
  for (double t = from_s; t <= to_s; t += 7.25) {
    const Vector3<double> expected = physical.at(t, span.spin_rate_rad_s).linear_m_s2;
    const Vector3<double> actual = environment.at(t, kepler.at(t)).linear_m_s2;
    error = std::fmax(error, norm(actual - expected));
    largest = std::fmax(largest, norm(expected));
  }
  return error / largest;
}

// Where a face turns out of the flow, its area |cos θ| has a kink of the slope 2ω, of which rows
// every h leave ¼ · 2ωh: 5e-3 of the drag on this face, which is less than half of the largest
// force.
TEST(EnvironmentTableOf, InertialPointingRepeats) {
  EXPECT_LT(
      interpolation_error(PhysicalEnvironment({}, {}), {.num_orbits = 3}, -4000.0, 3 * 5950.0),
      2.5e-3);
}

// The spin turns by 0.1 rad from row to row: ¼ · 2 · 0.1 = 5e-2 of the drag on one face. It is no
// multiple of f_orb, so the time before the session and its last orbit tell whether all rows are
// there: if they repeated, the error would be of the size of the force.
TEST(EnvironmentTableOf, SpinCoversTheWholeSession) {
  const EnvironmentSpan span{.spin_rate_rad_s = 4.4e-3, .settling_s = 4000.0, .num_orbits = 3};
  EnvironmentPhysics physics;
  physics.sun.pressure_pa = 0.0;
  EXPECT_LT(interpolation_error(PhysicalEnvironment(physics, {}), span, -4000.0, 3 * 5950.0), 5e-2);
}

}  // namespace
}  // namespace proofmass
