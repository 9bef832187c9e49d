#include "core/microscope/instrument/sensor_model.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace proofmass {
namespace {

constexpr Vector3<double> zero{};
const Matrix3<double> identity{{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}};

SensorModel<double> perfect_sensor() {
  return {.rest_position_S_m = zero,
          .motion_direction_S = zero,
          .parasitic_K_m_s2 = zero,
          .offset_K_m_s2 = zero,
          .sensitivity_KS = identity,
          .quadratic_s2_m = zero};
}

/// At rest above the Earth in the direction +X of S.
SatelliteMotion<double> at_rest() {
  return {.acceleration_S = zero,
          .gradient_s2 = 1e-6,
          .radial_S = {1.0, 0.0, 0.0},
          .omega_IS_S = zero,
          .omega_dot_IS_S = zero};
}

// A mass held above the centre of mass of a satellite that does not rotate falls slower than it:
// the electrodes must pull it down by 2(μ/r³)·height; beside the centre, push it out by
// (μ/r³)·distance.
TEST(KinematicAcceleration, HoldsAMassAgainstTheGravityGradient) {
  SensorModel<double> sensor = perfect_sensor();
  sensor.rest_position_S_m = {3.0, 5.0, 0.0};
  const Vector3<double> a = kinematic_acceleration(sensor, at_rest(), MassMotionPhase{});
  EXPECT_DOUBLE_EQ(a.x, -2e-6 * 3.0);
  EXPECT_DOUBLE_EQ(a.y, 1e-6 * 5.0);
  EXPECT_DOUBLE_EQ(a.z, 0.0);
}

TEST(KinematicAcceleration, HoldsAMassOnACircleAgainstItsInertia) {
  SensorModel<double> sensor = perfect_sensor();
  sensor.rest_position_S_m = {2.0, 0.0, 0.0};
  SatelliteMotion<double> satellite = at_rest();
  satellite.gradient_s2 = 0.0;
  satellite.omega_IS_S = {0.0, 0.5, 0.0};
  satellite.omega_dot_IS_S = {0.0, 0.0, 0.25};
  const Vector3<double> a = kinematic_acceleration(sensor, satellite, MassMotionPhase{});
  EXPECT_DOUBLE_EQ(a.x, -0.5 * 0.5 * 2.0);  // Towards the centre.
  EXPECT_DOUBLE_EQ(a.y, 0.25 * 2.0);        // Along the growing speed.
  EXPECT_DOUBLE_EQ(a.z, 0.0);
}

TEST(KinematicAcceleration, IncludesTheMotionOfTheMassAndItsCoriolisTerm) {
  SensorModel<double> sensor = perfect_sensor();
  sensor.motion_direction_S = {1.0, 0.0, 0.0};
  SatelliteMotion<double> satellite = at_rest();
  satellite.gradient_s2 = 0.0;
  satellite.omega_IS_S = {0.0, 0.0, 0.5};
  const MassMotionPhase motion{.position_m = 0.0, .velocity_m_s = 4.0, .acceleration_m_s2 = 8.0};
  const Vector3<double> a = kinematic_acceleration(sensor, satellite, motion);
  EXPECT_DOUBLE_EQ(a.x, 8.0);
  EXPECT_DOUBLE_EQ(a.y, 2.0 * 0.5 * 4.0);
  EXPECT_DOUBLE_EQ(a.z, 0.0);
}

TEST(KinematicAcceleration, FollowsTheSatelliteAsAWhole) {
  SatelliteMotion<double> satellite = at_rest();
  satellite.acceleration_S = {1.0, 2.0, 3.0};
  const Vector3<double> a = kinematic_acceleration(perfect_sensor(), satellite, MassMotionPhase{});
  EXPECT_EQ(a.x, 1.0);
  EXPECT_EQ(a.y, 2.0);
  EXPECT_EQ(a.z, 3.0);
}

// A parasitic acceleration alone, in a drag-free satellite at rest: the electrodes cancel it,
// Γ_App = −p, and eq:measurement gives b0 + M(0) − (K1 + η) p + K2 p².
TEST(MeasuredAcceleration, ShowsParasiticForcesThroughTheSymmetricPartAlone) {
  SensorModel<double> sensor = perfect_sensor();
  sensor.parasitic_K_m_s2 = {0.5, 0.0, 0.0};
  sensor.offset_K_m_s2 = {3.0 - 2.0 * 0.5, 0.0, 0.0};  // b0 = 3, K1 = 2.
  sensor.sensitivity_KS.row[0] = {2.0, 7.0, 7.0};
  sensor.quadratic_s2_m = {16.0, 0.0, 0.0};
  const Vector3<double> measured = measured_acceleration(sensor, zero);
  EXPECT_DOUBLE_EQ(measured.x, 3.0 - 2.0 * 0.5 + 16.0 * 0.25);
}

TEST(MeasuredAcceleration, SquaresEachComponentOfTheAppliedAcceleration) {
  SensorModel<double> sensor = perfect_sensor();
  sensor.quadratic_s2_m = {1.0, 10.0, 100.0};
  const Vector3<double> measured = measured_acceleration(sensor, {2.0, -3.0, 0.5});
  EXPECT_DOUBLE_EQ(measured.x, 2.0 + 4.0);
  EXPECT_DOUBLE_EQ(measured.y, -3.0 + 90.0);
  EXPECT_DOUBLE_EQ(measured.z, 0.5 + 25.0);
}

}  // namespace
}  // namespace proofmass
