#include "core/microscope/simulation/loop.hpp"

#include "core/math/eigen_vectors.hpp"
#include "core/microscope/control/star_tracker.hpp"
#include "core/microscope/instrument/stiffness.hpp"

namespace proofmass {
namespace {

/// s of q(t) = [θ]ᵀ e_a s Δ_TM sin(2π f t) for each mass.
std::array<double, 2> motion_factors(MassMotion motion) {
  switch (motion) {
    case MassMotion::opposition:
      return {-0.5, 0.5};
    case MassMotion::mass_1:
      return {1.0, 0.0};
    case MassMotion::mass_2:
      return {0.0, 1.0};
  }
  return {0.0, 0.0};
}

/// Directions of the motions that a session commands of the mass of sensor k. The force of the
/// electrodes takes the place of a second motion.
std::array<Eigen::Vector3d, num_mass_motions_max> motion_directions_S(const Session& session,
                                                                      const SensorConfig& config,
                                                                      const Sensor& sensor,
                                                                      std::size_t k) {
  std::array<Eigen::Vector3d, num_mass_motions_max> directions;
  directions.fill(Eigen::Vector3d::Zero());
  const MassExcitations excitations = mass_excitations(session);
  for (std::size_t i = 0; i < directions.size(); ++i) {
    if (excitations[i] == nullptr) continue;
    const double factor = motion_factors(excitations[i]->motion)[k];
    if (factor == 0.0) continue;
    const auto axis = static_cast<Eigen::Index>(index(excitations[i]->axis));
    directions[i] = factor * sensor.alignment_KS().transpose().col(axis);
  }
  if (feels_stiffness(config, session)) {
    directions[1] =
        stiffness_direction_S(sensor, config.radial_stiffness_s2[k], excitations[0]->axis,
                              motion_factors(excitations[0]->motion)[k]);
  }
  return directions;
}

SensorModel<double> make_sensor_model(const Sensor& sensor,
                                      const Eigen::Vector3d& rest_position_S_m,
                                      const std::array<Eigen::Vector3d, 2>& directions_S) {
  // measured_acceleration() applies [M] to Γ_App + p, so only the last two terms with p are
  // constant.
  const Eigen::Vector3d& p = sensor.parasitic_K_m_s2;
  return {.rest_position_S_m = vector3(rest_position_S_m),
          .motion_direction_S = vector3(directions_S[0]),
          .second_direction_S = vector3(directions_S[1]),
          .parasitic_K_m_s2 = vector3(p),
          .offset_K_m_s2 = vector3(sensor.read_out_bias_K_m_s2 - sensor.symmetric_part() * p),
          .sensitivity_KS = matrix3(sensor.sensitivity_KS()),
          .quadratic_s2_m = vector3(sensor.quadratic_s2_m)};
}

}  // namespace

LoopConstants<double> make_loop_constants(const Instrument& instrument, const Scenario& scenario,
                                          const Session& session) {
  const std::array<double, 2> weights = drag_free_weights(session.drag_free);
  const Eigen::Vector3d bias_error(scenario.drag_free.bias_compensation_error_x_m_s2,
                                   scenario.drag_free.bias_compensation_error_y_m_s2,
                                   scenario.drag_free.bias_compensation_error_z_m_s2);
  const Eigen::Vector3d unit_position(scenario.sensor.position_m.data());
  LoopConstants<double> constants;
  Eigen::Vector3d subtracted_bias = bias_error;
  for (std::size_t k = 0; k < 2; ++k) {
    const Sensor& sensor = instrument.sensors[k];
    // r_1 = r_c − ½Δ, r_2 = r_c + ½Δ
    const double side = k == 0 ? -0.5 : 0.5;
    constants.sensors[k] = make_sensor_model(
        sensor, unit_position + instrument.centre_offset_S_m + side * instrument.offcentring_S_m,
        motion_directions_S(session, scenario.sensor, sensor, k));
    subtracted_bias += weights[k] * sensor.read_out_bias_K_m_s2;
  }
  constants.sensor_range_m_s2 = scenario.sensor.range_m_s2;
  constants.drag_free_weight = weights;
  constants.subtracted_bias_S_m_s2 = vector3(subtracted_bias);
  constants.thrust_matrix = matrix3(instrument.thrust_matrix);
  constants.angular_bias_S_rad_s2 = vector3(instrument.angular_bias_S_rad_s2);
  const StarTracker star_tracker =
      make_star_tracker(scenario.noise, scenario.simulation.sample_period_s);
  constants.star_tracker_bias_S_rad =
      vector3(star_tracker.fused_bias_S(instrument.star_tracker_bias_S_rad));
  return constants;
}

}  // namespace proofmass
