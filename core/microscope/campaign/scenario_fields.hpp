#pragma once

// The one list of a scenario's fields: campaign files, definitions and the comparison of two
// campaigns all walk it. Included by core/microscope/campaign/scenario.hpp, which documents it.

#include "core/microscope/campaign/scenario.hpp"

namespace proofmass {
namespace detail {

template <typename AxisConfig, typename Visitor>
void visit_harmonic(AxisConfig& axis, std::array<std::string_view, 5> paths, Visitor& visit) {
  visit(FieldInfo{paths[0], "Constant part."}, axis.mean);
  visit(FieldInfo{paths[1], "Amplitude at f_orb.", range::not_negative}, axis.orbital);
  visit(FieldInfo{paths[2], "Phase at f_orb; cosine from perigee."}, axis.orbital_phase_rad);
  visit(FieldInfo{paths[3], "Amplitude at 2 f_orb.", range::not_negative}, axis.twice_orbital);
  visit(FieldInfo{paths[4], "Phase at 2 f_orb."}, axis.twice_orbital_phase_rad);
}

#define PROOFMASS_HARMONIC(axis, unit)                                                       \
  {                                                                                          \
    "environment." axis ".mean" unit, "environment." axis ".orbital" unit,                   \
        "environment." axis ".orbital_phase_rad", "environment." axis ".twice_orbital" unit, \
        "environment." axis ".twice_orbital_phase_rad"                                       \
  }

template <typename Config, typename Visitor>
void visit_environment(Config& environment, Visitor& visit) {
  visit(FieldInfo{"environment.kind", "\"harmonic\" (below) or \"file\" (environment.file)."},
        environment.kind);
  visit(FieldInfo{"environment.scale", "Multiplies every external acceleration; 0 is off.",
                  range::not_negative},
        environment.scale);
  visit_harmonic(environment.linear_x, PROOFMASS_HARMONIC("linear_x", "_m_s2"), visit);
  visit_harmonic(environment.linear_y, PROOFMASS_HARMONIC("linear_y", "_m_s2"), visit);
  visit_harmonic(environment.linear_z, PROOFMASS_HARMONIC("linear_z", "_m_s2"), visit);
  visit_harmonic(environment.angular_x, PROOFMASS_HARMONIC("angular_x", "_rad_s2"), visit);
  visit_harmonic(environment.angular_y, PROOFMASS_HARMONIC("angular_y", "_rad_s2"), visit);
  visit_harmonic(environment.angular_z, PROOFMASS_HARMONIC("angular_z", "_rad_s2"), visit);
}

#undef PROOFMASS_HARMONIC

template <typename Noise, typename Visitor>
void visit_sensor_noise(Noise& noise, std::array<std::string_view, 5> paths, Visitor& visit) {
  visit(FieldInfo{paths[0], "White level, unit/√Hz, one-sided.", range::positive}, noise.white_asd);
  visit(FieldInfo{paths[1], "1/f part equals the white one here.", range::between(0.0, 0.1)},
        noise.pink_corner_hz);
  visit(FieldInfo{paths[2], "Level of the f² rise at its corner; 0 for none.", range::not_negative},
        noise.rise_asd);
  visit(FieldInfo{paths[3], "Corner of the f² rise.", range::between(1e-3, 1.0)},
        noise.rise_corner_hz);
  visit(FieldInfo{paths[4], "The rise ends here; 0 for never.", range::between(0.0, 0.6)},
        noise.rise_limit_hz);
}

#define PROOFMASS_SENSOR_NOISE(axis, unit)                               \
  {                                                                      \
    "noise." axis ".white_asd" unit, "noise." axis ".pink_corner_hz",    \
        "noise." axis ".rise_asd" unit, "noise." axis ".rise_corner_hz", \
        "noise." axis ".rise_limit_hz"                                   \
  }

template <typename Config, typename Visitor>
void visit_wire(Config& wire, Visitor& visit) {
  visit(
      FieldInfo{"noise.wire.damping_n_m", "k/Q along X; 0 for no such noise.", range::not_negative},
      wire.damping_n_m);
  visit(FieldInfo{"noise.wire.temperature_k", "Of the wires.", range::positive},
        wire.temperature_k);
  visit(FieldInfo{"noise.wire.sensor_1_mass_kg", "Test mass of sensor 1.", range::positive},
        wire.mass_kg[0]);
  visit(FieldInfo{"noise.wire.sensor_2_mass_kg", "Test mass of sensor 2.", range::positive},
        wire.mass_kg[1]);
  visit(FieldInfo{"noise.wire.sensor_1_factor", "Multiplies the wire's noise in sensor 1.",
                  range::not_negative},
        wire.factor[0]);
  visit(FieldInfo{"noise.wire.sensor_2_factor", "Multiplies the wire's noise in sensor 2.",
                  range::not_negative},
        wire.factor[1]);
}

template <typename Config, typename Visitor>
void visit_noise(Config& noise, Visitor& visit) {
  visit(
      FieldInfo{
          "noise.preset",
          "\"design_2013\", \"flight_suref\", \"wire_suref\" or \"wire_suep\"; sets what follows."},
      noise.preset);
  visit(FieldInfo{"noise.scale", "Multiplies every noise; 0 is off.", range::not_negative},
        noise.scale);
  visit_sensor_noise(noise.linear_x, PROOFMASS_SENSOR_NOISE("linear_x", "_m_s2"), visit);
  visit_sensor_noise(noise.linear_yz, PROOFMASS_SENSOR_NOISE("linear_yz", "_m_s2"), visit);
  visit_sensor_noise(noise.angular, PROOFMASS_SENSOR_NOISE("angular", "_rad_s2"), visit);
  visit(FieldInfo{"noise.star_tracker_across_asd_rad", "One head, across its boresight, rad/√Hz.",
                  range::positive},
        noise.star_tracker_across_asd_rad);
  visit(FieldInfo{"noise.star_tracker_boresight_asd_rad", "One head, about its boresight, rad/√Hz.",
                  range::positive},
        noise.star_tracker_boresight_asd_rad);
  visit(
      FieldInfo{"noise.thrust_asd_m_s2", "Propulsion, each axis, (m/s²)/√Hz.", range::not_negative},
      noise.thrust_asd_m_s2);
  visit(FieldInfo{"noise.torque_asd_rad_s2", "Attitude actuation, each axis, (rad/s²)/√Hz.",
                  range::not_negative},
        noise.torque_asd_rad_s2);
  visit(FieldInfo{"noise.sensor_1_factor", "Multiplies the linear noise of sensor 1.",
                  range::between(1e-3, 1e3)},
        noise.linear_factor[0]);
  visit(FieldInfo{"noise.sensor_2_factor", "Multiplies the linear noise of sensor 2.",
                  range::between(1e-3, 1e3)},
        noise.linear_factor[1]);
  visit_wire(noise.wire, visit);
}

#undef PROOFMASS_SENSOR_NOISE

template <typename Config, typename Visitor>
void visit_control(Config& scenario, Visitor& visit) {
  auto& linear = scenario.drag_free;
  visit(FieldInfo{"drag_free.bandwidth_hz", "Crossover of the linear loop.",
                  range::between(1e-3, 0.2)},
        linear.bandwidth_hz);
  visit(FieldInfo{"drag_free.integral_hz", "Corner of its integral.", range::between(0.0, 0.05)},
        linear.integral_hz);
  if (scenario.has_tests()) {
    visit(FieldInfo{"drag_free.resonator_damping",
                    "Of a resonator at f_EP in sessions that test; 0 for none.",
                    range::between(0.0, 0.9)},
          linear.resonator_damping);
  }
  visit(FieldInfo{"drag_free.bias_compensation_error_x_m_s2", "Error of the subtracted bias, X."},
        linear.bias_compensation_error_x_m_s2);
  visit(FieldInfo{"drag_free.bias_compensation_error_y_m_s2", "Error of the subtracted bias, Y."},
        linear.bias_compensation_error_y_m_s2);
  visit(FieldInfo{"drag_free.bias_compensation_error_z_m_s2", "Error of the subtracted bias, Z."},
        linear.bias_compensation_error_z_m_s2);
  auto& attitude = scenario.attitude;
  visit(FieldInfo{"attitude.bandwidth_hz", "Natural frequency of the attitude loop.",
                  range::between(1e-3, 0.1)},
        attitude.bandwidth_hz);
  visit(FieldInfo{"attitude.damping", "Its damping ratio.", range::between(0.3, 2.0)},
        attitude.damping);
  visit(
      FieldInfo{"attitude.integral_hz", "Corner of its slow integral.", range::between(0.0, 5e-3)},
      attitude.integral_hz);
  visit(FieldInfo{"attitude.blending_hz", "Star tracker below, angular accelerometer above.",
                  range::between(1e-4, 0.1)},
        attitude.blending_hz);
}

template <typename Config, typename Visitor>
void visit_sensor(Config& sensor, Visitor& visit) {
  visit(FieldInfo{"sensor.range_m_s2", "Largest acceleration that a sensor reports.",
                  range::positive},
        sensor.range_m_s2);
  constexpr std::array<std::string_view, 3> positions{"sensor.position_x_m", "sensor.position_y_m",
                                                      "sensor.position_z_m"};
  for (std::size_t axis = 0; axis < positions.size(); ++axis) {
    visit(FieldInfo{positions[axis], "Of the unit, from the centre of mass.",
                    range::between(-10.0, 10.0)},
          sensor.position_m[axis]);
  }
  constexpr std::array<std::string_view, 2> stiffnesses{"sensor.sensor_1_radial_stiffness_s2",
                                                        "sensor.sensor_2_radial_stiffness_s2"};
  for (std::size_t k = 0; k < stiffnesses.size(); ++k) {
    visit(FieldInfo{stiffnesses[k], "k/m along Y and Z, where a mass moves.",
                    range::between(-10.0, 10.0)},
          sensor.radial_stiffness_s2[k]);
  }
}

template <typename Config, typename Visitor>
void visit_gaps(Config& gaps, Visitor& visit) {
  const Range depth = range::between(0.0, 1.0), duration = range::between(1.0, 1e5);
  visit(FieldInfo{"gaps.glitch_rate_hz", "Mean rate of glitches in tests; 0 for none.",
                  range::between(0.0, 1.0)},
        gaps.glitch_rate_hz);
  visit(FieldInfo{"gaps.glitch_duration_s", "Data discarded from a glitch on.", duration},
        gaps.glitch_duration_s);
  visit(FieldInfo{"gaps.orbital_modulation", "Part of the rate that follows f_orb.", depth},
        gaps.orbital.depth);
  visit(FieldInfo{"gaps.orbital_phase_rad", "Cosine from the session's start."},
        gaps.orbital.phase_rad);
  visit(FieldInfo{"gaps.spin_modulation", "Part that follows f_spin, the Sun's frequency.", depth},
        gaps.spin.depth);
  visit(FieldInfo{"gaps.spin_phase_rad", "Cosine from the session's start."}, gaps.spin.phase_rad);
  visit(FieldInfo{"gaps.test_modulation", "Part that follows f_EP, the Earth's frequency.", depth},
        gaps.test.depth);
  visit(FieldInfo{"gaps.test_phase_rad", "Cosine from the session's start."}, gaps.test.phase_rad);
  visit(FieldInfo{"gaps.telemetry_rate_hz", "Rate of gaps in the telemetry; 0 for none.",
                  range::between(0.0, 1.0)},
        gaps.telemetry_rate_hz);
  visit(FieldInfo{"gaps.telemetry_duration_s", "Length of one.", duration},
        gaps.telemetry_duration_s);
}

template <typename Config, typename Visitor>
void visit_realism(Config& realism, Visitor& visit) {
  const auto number = [&](std::string_view path, std::string_view comment, auto& value,
                          const Range& range = range::any) {
    visit(FieldInfo{path, comment, range}, value);
  };
  const auto size = [&](std::string_view path, std::string_view comment, auto& value) {
    visit(FieldInfo{path, comment, range::not_negative}, value);
  };
  size("realism.star_tracker_orbital_error_rad", "At f_orb, about each axis of S.",
       realism.star_tracker_orbital_error_rad);
  number("realism.star_tracker_orbital_phase_rad", "Sine from the campaign's start.",
         realism.star_tracker_orbital_phase_rad);
  number("realism.star_tracker_latency_samples", "Age of its angles.",
         realism.star_tracker_latency_samples, range::between(0, 240));
  size("realism.thrust_limit_m_s2", "Of an axis; 0 for none.", realism.thrust_limit_m_s2);
  size("realism.thrust_quantum_m_s2", "Its step; 0 for none.", realism.thrust_quantum_m_s2);
  size("realism.torque_limit_rad_s2", "Of an axis; 0 for none.", realism.torque_limit_rad_s2);
  size("realism.torque_quantum_rad_s2", "Its step; 0 for none.", realism.torque_quantum_rad_s2);
  number("realism.actuation_lag_s", "Time constant of thrust and torque; 0 for none.",
         realism.actuation_lag_s, range::between(0.0, 100.0));
  size("realism.mass_kg", "Of the satellite.", realism.mass_kg);
  size("realism.inertia_xx_kg_m2", "0 for no dynamics of rotation.", realism.inertia_kg_m2[0]);
  size("realism.inertia_yy_kg_m2", "Of the satellite.", realism.inertia_kg_m2[1]);
  size("realism.inertia_zz_kg_m2", "Of the satellite.", realism.inertia_kg_m2[2]);
  number("realism.inertia_xy_kg_m2", "Element of the tensor.", realism.inertia_products_kg_m2[0]);
  number("realism.inertia_xz_kg_m2", "Element of the tensor.", realism.inertia_products_kg_m2[1]);
  number("realism.inertia_yz_kg_m2", "Element of the tensor.", realism.inertia_products_kg_m2[2]);
  number("realism.thrust_arm_x_m", "Place where thrust acts.", realism.thrust_arm_m[0]);
  number("realism.thrust_arm_y_m", "From the centre of mass.", realism.thrust_arm_m[1]);
  number("realism.thrust_arm_z_m", "In S.", realism.thrust_arm_m[2]);
  const Range small = range::between(-0.5, 0.5);
  number("realism.sensor_1_angular_scale_error", "Of its angular measurement.",
         realism.angular_scale_error[0], small);
  number("realism.sensor_2_angular_scale_error", "Of its angular measurement.",
         realism.angular_scale_error[1], small);
  number("realism.angular_alignment", "Part of a sensor's misalignment in it.",
         realism.angular_alignment, range::between(0.0, 1.0));
  const Range slow = range::between(-1e-9, 1e-9);
  number("realism.sensor_1_bias_drift_m_s3", "On each axis.", realism.bias_drift_m_s3[0], slow);
  number("realism.sensor_2_bias_drift_m_s3", "On each axis.", realism.bias_drift_m_s3[1], slow);
  number("realism.sensor_1_scale_drift_per_s", "On each axis.", realism.scale_drift_per_s[0], slow);
  number("realism.sensor_2_scale_drift_per_s", "On each axis.", realism.scale_drift_per_s[1], slow);
}

template <typename Config, typename Visitor>
void visit_estimation(Config& estimation, Visitor& visit) {
  visit(FieldInfo{"estimation.method",
                  "\"hardy2013\": one parameter a session, iterated; \"joint\": all at once."},
        estimation.method);
  visit(FieldInfo{"estimation.correction",
                  "\"hardy2013\" (the paper's), \"first_order\" or \"second_order\"."},
        estimation.correction);
  visit(FieldInfo{"estimation.transient_s", "Filtered record dropped at a session's start.",
                  range::not_negative},
        estimation.transient_s);
  visit(FieldInfo{"estimation.band_ratio", "Band-pass from f/ratio to f·ratio.",
                  range::between(1.1, 20.0)},
        estimation.band_ratio);
  visit(FieldInfo{"estimation.convergence", "Done when estimates move by less, in objectives.",
                  range::between(1e-12, 1.0)},
        estimation.convergence);
  visit(FieldInfo{"estimation.num_rounds_max", "Rounds at most.", range::between(1, 1000)},
        estimation.num_rounds_max);
}

template <typename Config, typename Visitor>
void visit_tables(Config& scenario, Visitor& visit) {
  auto& acceptance = scenario.acceptance;
  visit(FieldInfo{"acceptance.a_d11_max", "Bound of |a_d11|.", range::positive},
        acceptance.a_d11_max);
  visit(FieldInfo{"acceptance.a_d1j_max_rad", "Bound of |a_d12| and |a_d13|.", range::positive},
        acceptance.a_d1j_max_rad);
  visit(FieldInfo{"acceptance.a_c1j_max_rad", "Bound of |a_c12| and |a_c13|.", range::positive},
        acceptance.a_c1j_max_rad);
  for (std::size_t i = 0; i < num_parameters; ++i) {
    visit(FieldInfo{objective_path(i), "Largest acceptable |error|.", range::positive},
          scenario.objectives[i]);
  }
  for (std::size_t i = 0; scenario.has_tests() && i < num_test_objectives; ++i) {
    visit(FieldInfo{test_objective_path(i), "Largest acceptable |error|.", range::positive},
          scenario.test_objectives[i]);
  }
  auto& budget = scenario.budget;
  visit(FieldInfo{"budget.test_spin_rate_rad_s", "2π f_spin of the test, about Y; 0 is inertial.",
                  range::between(-0.05, 0.05)},
        budget.test_spin_rate_rad_s);
  visit(FieldInfo{"budget.t_xy_s2", "T_xy at the test frequency.", range::positive},
        budget.t_xy_s2);
  visit(FieldInfo{"budget.residual_m_s2", "Drag-free residue that no run tells.", range::positive},
        budget.residual_m_s2);
  visit(
      FieldInfo{"budget.differential_m_s2", "Constant differential acceleration.", range::positive},
      budget.differential_m_s2);
  visit(FieldInfo{"budget.offcentring_max_m", "Bound before calibration.", range::positive},
        budget.offcentring_max_m);
  visit(FieldInfo{"budget.scale_factor_error_max", "Bound before calibration.", range::positive},
        budget.scale_factor_error_max);
  visit(FieldInfo{"budget.quadratic_factor_max_s2_m", "Bound before calibration.", range::positive},
        budget.quadratic_factor_max_s2_m);
}

}  // namespace detail

template <typename Config, typename Visitor>
void for_each_field(Config& scenario, Visitor&& visit) {
  visit(FieldInfo{"orbit.period_s", "Orbital period.", range::between(5000.0, 100000.0)},
        scenario.orbit.period_s);
  visit(FieldInfo{"orbit.eccentricity", "Perigee is on +X; files: at most 0.1, first order.",
                  range::between(0.0, 0.5)},
        scenario.orbit.eccentricity);
  visit(FieldInfo{"simulation.sample_period_s", "Rate of instrument and control.",
                  range::between(0.05, 1.0)},
        scenario.simulation.sample_period_s);
  visit(FieldInfo{"simulation.settling_s", "Loops run this long before a record begins.",
                  range::between(0.0, 50000.0)},
        scenario.simulation.settling_s);
  detail::visit_environment(scenario.environment, visit);
  detail::visit_noise(scenario.noise, visit);
  detail::visit_control(scenario, visit);
  detail::visit_sensor(scenario.sensor, visit);
  if (scenario.has_tests()) detail::visit_gaps(scenario.gaps, visit);
  if (scenario.realism) detail::visit_realism(*scenario.realism, visit);
  detail::visit_estimation(scenario.estimation, visit);
  detail::visit_tables(scenario, visit);
}

}  // namespace proofmass
