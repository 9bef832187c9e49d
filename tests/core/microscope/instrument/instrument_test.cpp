#include "core/microscope/instrument/instrument.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/microscope/instrument/sensor_model.hpp"
#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr double epsilon = 2.3e-16;

/// Every quantity has a value of its own, so that a swapped index shows.
DrawnValues distinct_values() {
  DrawnValues values{};
  for (std::size_t i = 0; i < num_drawn; ++i) values[i] = 1e-3 * static_cast<double>(i + 1);
  return values;
}

Instrument perfect_instrument() { return make_instrument({}); }
Sensor perfect_sensor() { return perfect_instrument().sensors[0]; }

TEST(Sensor, SensitivityMatrixIsThePrintedOne) {
  Sensor sensor = perfect_sensor();
  sensor.scale_factor = {2.0, 3.0, 5.0};
  sensor.coupling_rad = {0.25, 0.5, 0.125};            // η_x, η_y, η_z
  sensor.misalignment_SK_rad = {0.0625, 0.75, 0.375};  // θ_x, θ_y, θ_z
  Eigen::Matrix3d printed;
  printed << 2.0, 0.125 + 0.375, 0.5 - 0.75,  //
      0.125 - 0.375, 3.0, 0.25 + 0.0625,      //
      0.5 + 0.75, 0.25 - 0.0625, 5.0;
  EXPECT_EQ(sensor.sensitivity_KS(), printed);
}

TEST(Sensor, AlignmentIsTheRotationAtFirstOrder) {
  Sensor sensor = perfect_sensor();
  sensor.misalignment_SK_rad = {1e-3, -2e-3, 3e-3};
  // A rotation of the frame by θ turns components by v − θ∧v.
  const Eigen::Vector3d v(0.3, -0.7, 0.2);
  const Eigen::Vector3d expected = v - sensor.misalignment_SK_rad.cross(v);
  EXPECT_LT((sensor.alignment_KS() * v - expected).norm(), 4 * epsilon);
}

TEST(Instrument, TakesEveryDrawnValueOnce) {
  const Instrument instrument = make_instrument(distinct_values());
  // Positions in drawn_names(): groups in file order, sensor 1 before sensor 2, x before y before
  // z.
  EXPECT_EQ(instrument.sensors[0].scale_factor.x(), 1.0 + 1e-3);
  EXPECT_EQ(instrument.sensors[1].scale_factor.z(), 1.0 + 6e-3);
  const auto value_of = [](std::string_view name) {
    for (std::size_t i = 0; i < num_drawn; ++i) {
      if (drawn_names()[i] == name) return distinct_values()[i];
    }
    ADD_FAILURE() << "no drawn quantity " << name;
    return 0.0;
  };
  EXPECT_EQ(instrument.sensors[1].misalignment_SK_rad.y(), value_of("misalignment_rad.sensor_2_y"));
  EXPECT_EQ(instrument.sensors[0].coupling_rad.z(), value_of("coupling_rad.sensor_1_z"));
  EXPECT_EQ(instrument.sensors[1].quadratic_s2_m.x(), value_of("quadratic_factor_s2_m.sensor_2_x"));
  EXPECT_EQ(instrument.sensors[0].read_out_bias_K_m_s2.y(),
            value_of("read_out_bias_m_s2.sensor_1_y"));
  EXPECT_EQ(instrument.sensors[1].parasitic_K_m_s2.z(),
            value_of("parasitic_acceleration_m_s2.sensor_2_z"));
  EXPECT_EQ(instrument.offcentring_S_m.z(), value_of("offcentring_m.z"));
  EXPECT_EQ(instrument.centre_offset_S_m.x(), value_of("centre_of_mass_offset_m.x"));
  EXPECT_EQ(instrument.angular_bias_S_rad_s2.y(), value_of("angular_bias_rad_s2.y"));
  EXPECT_EQ(instrument.thrust_matrix(1, 1), 1.0 + value_of("thruster_scale_error.y"));
  EXPECT_EQ(instrument.thrust_matrix(0, 2), value_of("thruster_coupling_rad.xz"));
  EXPECT_EQ(instrument.thrust_matrix(2, 0), value_of("thruster_coupling_rad.zx"));
  EXPECT_EQ(instrument.star_tracker_bias_S_rad[1].x(), value_of("star_tracker_bias_rad.head_2_x"));
}

// What the matrices are for: eliminating the common applied acceleration from two linear sensors
// gives mes_d = A_d mes_c + A_c g_d, along every axis of either.
TEST(SensitivityMatrices, ExpressTheDifferenceThroughTheCommonMeasurement) {
  const Instrument instrument = make_instrument(distinct_values());
  const auto [a_c, a_d] = sensitivity_matrices(instrument);
  for (Eigen::Index axis = 0; axis < 6; ++axis) {
    Eigen::Vector<double, 6> unit = Eigen::Vector<double, 6>::Zero();
    unit[axis] = 1.0;
    const Eigen::Vector3d common = unit.head<3>(), difference = unit.tail<3>();
    const Eigen::Vector3d m1 = instrument.sensors[0].sensitivity_KS() * (common + difference);
    const Eigen::Vector3d m2 = instrument.sensors[1].sensitivity_KS() * (common - difference);
    const Eigen::Vector3d residual = 0.5 * (m1 - m2) - a_d * 0.5 * (m1 + m2) - a_c * difference;
    EXPECT_LT(residual.norm(), 20 * epsilon) << axis;
  }
}

TEST(TrueParameters, FollowTheirDefinitions) {
  Instrument instrument = perfect_instrument();
  instrument.sensors[0].scale_factor.x() = 1.5;
  instrument.sensors[1].scale_factor.x() = 0.5;  // K1c = 1, K1d = ½: a_d11 = ½, a_c11 = ¾.
  instrument.sensors[0].quadratic_s2_m.x() = 12.0;
  instrument.sensors[1].quadratic_s2_m.x() = 4.0;  // K2c = 8, K2d = 4.
  instrument.sensors[0].parasitic_K_m_s2.x() = 0.25;
  instrument.sensors[1].parasitic_K_m_s2.x() = 0.75;  // b_1d = ¼.
  instrument.offcentring_S_m = {1.0, 2.0, 4.0};
  const ParameterArray truth = true_parameters(instrument, /*bias_error_x_m_s2=*/0.125);
  const auto at = [&truth](Parameter parameter) { return truth[index(parameter)]; };
  EXPECT_DOUBLE_EQ(at(Parameter::a_c11_delta_x), 0.75);
  EXPECT_DOUBLE_EQ(at(Parameter::a_c11_delta_y), 1.5);
  EXPECT_DOUBLE_EQ(at(Parameter::a_c11_delta_z), 3.0);
  EXPECT_DOUBLE_EQ(at(Parameter::a_d11_prime), 0.5 + 2 * 8 * 0.25 + 2 * 4 * 0.125);
  EXPECT_DOUBLE_EQ(at(Parameter::k2c), 8.0);
  EXPECT_DOUBLE_EQ(at(Parameter::k2d), 4.0);
  EXPECT_DOUBLE_EQ(at(Parameter::a_d12), 0.0);
}

const Matrix3<double> identity{{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}};

SensorModel<double> perfect_model() {
  return {.rest_position_S_m = zero,
          .motion_direction_S = zero,
          .second_direction_S = zero,
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
  SensorModel<double> sensor = perfect_model();
  sensor.rest_position_S_m = {3.0, 5.0, 0.0};
  SatelliteMotion<double> satellite = at_rest();
  Vector3<double> a = kinematic_acceleration(sensor, satellite, MassMotionPhase{});
  EXPECT_DOUBLE_EQ(a.x, -2e-6 * 3.0);
  EXPECT_DOUBLE_EQ(a.y, 1e-6 * 5.0);
  EXPECT_DOUBLE_EQ(a.z, 0.0);
  satellite.acceleration_S = {0.0, 0.0, 3.0};
  a = kinematic_acceleration(sensor, satellite, MassMotionPhase{});
  EXPECT_DOUBLE_EQ(a.z, 3.0) << "it follows the satellite as a whole";
}

TEST(KinematicAcceleration, HoldsAMassOnACircleAgainstItsInertia) {
  SensorModel<double> sensor = perfect_model();
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

// Two motions at once are the sum of each alone, with the Coriolis acceleration of each.
TEST(KinematicAcceleration, AddsASecondMotion) {
  SensorModel<double> sensor = perfect_model();
  sensor.motion_direction_S = {0.0, 1.0, 0.0};
  sensor.second_direction_S = {0.0, 0.0, 1.0};
  SatelliteMotion<double> satellite = at_rest();
  satellite.omega_IS_S = {0.5, 0.0, 0.0};
  const MassMotionPhase first{.position_m = 3.0, .velocity_m_s = 4.0, .acceleration_m_s2 = 8.0};
  const MassMotionPhase second{.position_m = 5.0, .velocity_m_s = 6.0, .acceleration_m_s2 = 7.0};
  const Vector3<double> a = kinematic_acceleration(sensor, satellite, first, second);
  EXPECT_DOUBLE_EQ(a.x, 0.0);
  EXPECT_DOUBLE_EQ(a.y, (1e-6 - 0.25) * 3.0 - 2.0 * 0.5 * 6.0 + 8.0);
  EXPECT_DOUBLE_EQ(a.z, (1e-6 - 0.25) * 5.0 + 2.0 * 0.5 * 4.0 + 7.0);
}

// A parasitic acceleration alone, in a drag-free satellite at rest: the electrodes cancel it,
// Γ_App = −p, and eq:measurement gives b0 + M(0) − (K1 + η) p + K2 p².
TEST(MeasuredAcceleration, ShowsParasiticForcesThroughTheSymmetricPartAlone) {
  SensorModel<double> sensor = perfect_model();
  sensor.parasitic_K_m_s2 = {0.5, 0.0, 0.0};
  sensor.offset_K_m_s2 = {3.0 - 2.0 * 0.5, 0.0, 0.0};  // b0 = 3, K1 = 2.
  sensor.sensitivity_KS.row[0] = {2.0, 7.0, 7.0};
  sensor.quadratic_s2_m = {16.0, 0.0, 0.0};
  const Vector3<double> measured = measured_acceleration(sensor, zero);
  EXPECT_DOUBLE_EQ(measured.x, 3.0 - 2.0 * 0.5 + 16.0 * 0.25);
}

TEST(MeasuredAcceleration, SquaresEachComponentOfTheAppliedAcceleration) {
  SensorModel<double> sensor = perfect_model();
  sensor.quadratic_s2_m = {1.0, 10.0, 100.0};
  const Vector3<double> measured = measured_acceleration(sensor, {2.0, -3.0, 0.5});
  EXPECT_DOUBLE_EQ(measured.x, 2.0 + 4.0);
  EXPECT_DOUBLE_EQ(measured.y, -3.0 + 90.0);
  EXPECT_DOUBLE_EQ(measured.z, 0.5 + 25.0);
}

}  // namespace
}  // namespace proofmass
