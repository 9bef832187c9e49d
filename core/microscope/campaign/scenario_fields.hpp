#pragma once

// The one list of a scenario's fields: campaign files, definitions and the comparison of two
// campaigns all walk it. Included by core/microscope/campaign/scenario.hpp, which documents it.

#include <algorithm>
#include <string>

#include "core/microscope/campaign/scenario.hpp"

namespace proofmass {
namespace detail {

/// Visits fields of one table.
template <typename Visitor>
struct TableFields {
  std::string table;  ///< `noise.wire`.
  Visitor& visit;

  template <typename Value>
  void operator()(std::string_view key, std::string_view comment, Value& value,
                  const Range& range = range::any) const {
    const std::string path = table + "." + std::string(key);
    visit(FieldInfo{path, comment, range}, value);
  }

  /// A number of each sensor: `sensor_1_` and `sensor_2_` with this ending.
  /// @param comment  With # for the number of the sensor.
  template <typename Pair>
  void of_sensors(const std::string& ending, const std::string& comment, Pair& values,
                  const Range& range) const {
    for (std::size_t k = 0; k < values.size(); ++k) {
      std::string own = comment;
      std::ranges::replace(own, '#', static_cast<char>('1' + k));
      (*this)("sensor_" + std::to_string(k + 1) + "_" + ending, own, values[k], range);
    }
  }
};
template <typename Visitor>
TableFields(std::string, Visitor&) -> TableFields<Visitor>;

template <typename AxisConfig, typename Visitor>
void visit_harmonic(AxisConfig& axis, const std::string& name, const std::string& unit,
                    Visitor& visit) {
  const TableFields field{"environment." + name, visit};
  field("mean" + unit, "Constant part.", axis.mean);
  field("orbital" + unit, "Amplitude at f_orb.", axis.orbital, range::not_negative);
  field("orbital_phase_rad", "Phase at f_orb; cosine from perigee.", axis.orbital_phase_rad);
  field("twice_orbital" + unit, "Amplitude at 2 f_orb.", axis.twice_orbital, range::not_negative);
  field("twice_orbital_phase_rad", "Phase at 2 f_orb.", axis.twice_orbital_phase_rad);
}

template <typename Config, typename Visitor>
void visit_environment(Config& environment, Visitor& visit) {
  const TableFields field{"environment", visit};
  field("kind", "\"harmonic\" (below) or \"file\" (environment.file).", environment.kind);
  field("scale", "Multiplies every external acceleration; 0 is off.", environment.scale,
        range::not_negative);
  visit_harmonic(environment.linear_x, "linear_x", "_m_s2", visit);
  visit_harmonic(environment.linear_y, "linear_y", "_m_s2", visit);
  visit_harmonic(environment.linear_z, "linear_z", "_m_s2", visit);
  visit_harmonic(environment.angular_x, "angular_x", "_rad_s2", visit);
  visit_harmonic(environment.angular_y, "angular_y", "_rad_s2", visit);
  visit_harmonic(environment.angular_z, "angular_z", "_rad_s2", visit);
}

template <typename Noise, typename Visitor>
void visit_sensor_noise(Noise& noise, const std::string& name, const std::string& unit,
                        Visitor& visit) {
  const TableFields field{"noise." + name, visit};
  field("white_asd" + unit, "White level, unit/√Hz, one-sided.", noise.white_asd, range::positive);
  field("pink_corner_hz", "1/f part equals the white one here.", noise.pink_corner_hz,
        range::between(0.0, 0.1));
  field("rise_asd" + unit, "Level of the f² rise at its corner; 0 for none.", noise.rise_asd,
        range::not_negative);
  field("rise_corner_hz", "Corner of the f² rise.", noise.rise_corner_hz,
        range::between(1e-3, 1.0));
  field("rise_limit_hz", "The rise ends here; 0 for never.", noise.rise_limit_hz,
        range::between(0.0, 0.6));
}

template <typename Config, typename Visitor>
void visit_noise(Config& noise, Visitor& visit) {
  const TableFields field{"noise", visit};
  field("preset",
        "\"design_2013\", \"flight_suref\", \"wire_suref\" or \"wire_suep\"; sets what follows.",
        noise.preset);
  field("scale", "Multiplies every noise; 0 is off.", noise.scale, range::not_negative);
  visit_sensor_noise(noise.linear_x, "linear_x", "_m_s2", visit);
  visit_sensor_noise(noise.linear_yz, "linear_yz", "_m_s2", visit);
  visit_sensor_noise(noise.angular, "angular", "_rad_s2", visit);
  field("star_tracker_across_asd_rad", "One head, across its boresight, rad/√Hz.",
        noise.star_tracker_across_asd_rad, range::positive);
  field("star_tracker_boresight_asd_rad", "One head, about its boresight, rad/√Hz.",
        noise.star_tracker_boresight_asd_rad, range::positive);
  field("thrust_asd_m_s2", "Propulsion, each axis, (m/s²)/√Hz.", noise.thrust_asd_m_s2,
        range::not_negative);
  field("torque_asd_rad_s2", "Attitude actuation, each axis, (rad/s²)/√Hz.",
        noise.torque_asd_rad_s2, range::not_negative);
  field.of_sensors("factor", "Multiplies the linear noise of sensor #.", noise.linear_factor,
                   range::between(1e-3, 1e3));
  const TableFields of_wire{"noise.wire", visit};
  of_wire("damping_n_m", "k/Q along X; 0 for no such noise.", noise.wire.damping_n_m,
          range::not_negative);
  of_wire("temperature_k", "Of the wires.", noise.wire.temperature_k, range::positive);
  of_wire.of_sensors("mass_kg", "Test mass of sensor #.", noise.wire.mass_kg, range::positive);
  of_wire.of_sensors("factor", "Multiplies the wire's noise in sensor #.", noise.wire.factor,
                     range::not_negative);
}

template <typename Config, typename Visitor>
void visit_control(Config& scenario, Visitor& visit) {
  auto& linear = scenario.drag_free;
  const TableFields field{"drag_free", visit};
  field("bandwidth_hz", "Crossover of the linear loop.", linear.bandwidth_hz,
        range::between(1e-3, 0.2));
  field("integral_hz", "Corner of its integral.", linear.integral_hz, range::between(0.0, 0.05));
  if (scenario.has_tests()) {
    field("resonator_damping", "Of a resonator at f_EP in sessions that test; 0 for none.",
          linear.resonator_damping, range::between(0.0, 0.9));
  }
  field("bias_compensation_error_x_m_s2", "Error of the subtracted bias, X.",
        linear.bias_compensation_error_x_m_s2);
  field("bias_compensation_error_y_m_s2", "Error of the subtracted bias, Y.",
        linear.bias_compensation_error_y_m_s2);
  field("bias_compensation_error_z_m_s2", "Error of the subtracted bias, Z.",
        linear.bias_compensation_error_z_m_s2);
  auto& attitude = scenario.attitude;
  const TableFields of_attitude{"attitude", visit};
  of_attitude("bandwidth_hz", "Natural frequency of the attitude loop.", attitude.bandwidth_hz,
              range::between(1e-3, 0.1));
  of_attitude("damping", "Its damping ratio.", attitude.damping, range::between(0.3, 2.0));
  of_attitude("integral_hz", "Corner of its slow integral.", attitude.integral_hz,
              range::between(0.0, 5e-3));
  of_attitude("blending_hz", "Star tracker below, angular accelerometer above.",
              attitude.blending_hz, range::between(1e-4, 0.1));
}

template <typename Config, typename Visitor>
void visit_sensor(Config& sensor, Visitor& visit) {
  const TableFields field{"sensor", visit};
  field("range_m_s2", "Largest acceleration that a sensor reports.", sensor.range_m_s2,
        range::positive);
  for (std::size_t axis = 0; axis < sensor.position_m.size(); ++axis) {
    field(std::string("position_") + "xyz"[axis] + "_m", "Of the unit, from the centre of mass.",
          sensor.position_m[axis], range::between(-10.0, 10.0));
  }
  field.of_sensors("radial_stiffness_s2", "k/m along Y and Z, where a mass moves.",
                   sensor.radial_stiffness_s2, range::between(-10.0, 10.0));
}

template <typename Config, typename Visitor>
void visit_gaps(Config& gaps, Visitor& visit) {
  const TableFields field{"gaps", visit};
  const Range rate = range::between(0.0, 1.0), depth = rate, duration = range::between(1.0, 1e5);
  field("glitch_rate_hz", "Mean rate of glitches in tests; 0 for none.", gaps.glitch_rate_hz, rate);
  field("glitch_duration_s", "Data discarded from a glitch on.", gaps.glitch_duration_s, duration);
  field("orbital_modulation", "Part of the rate that follows f_orb.", gaps.orbital.depth, depth);
  field("orbital_phase_rad", "Cosine from the session's start.", gaps.orbital.phase_rad);
  field("spin_modulation", "Part that follows f_spin, the Sun's frequency.", gaps.spin.depth,
        depth);
  field("spin_phase_rad", "Cosine from the session's start.", gaps.spin.phase_rad);
  field("test_modulation", "Part that follows f_EP, the Earth's frequency.", gaps.test.depth,
        depth);
  field("test_phase_rad", "Cosine from the session's start.", gaps.test.phase_rad);
  field("telemetry_rate_hz", "Rate of gaps in the telemetry; 0 for none.", gaps.telemetry_rate_hz,
        rate);
  field("telemetry_duration_s", "Length of one.", gaps.telemetry_duration_s, duration);
}

template <typename Config, typename Visitor>
void visit_realism(Config& realism, Visitor& visit) {
  const TableFields field{"realism", visit};
  const Range size = range::not_negative;
  field("star_tracker_orbital_error_rad", "At f_orb, about each axis of S.",
        realism.star_tracker_orbital_error_rad, size);
  field("star_tracker_orbital_phase_rad", "Sine from the campaign's start.",
        realism.star_tracker_orbital_phase_rad);
  field("star_tracker_latency_samples", "Age of its angles.", realism.star_tracker_latency_samples,
        range::between(0, 240));
  field("thrust_limit_m_s2", "Of an axis; 0 for none.", realism.thrust_limit_m_s2, size);
  field("thrust_quantum_m_s2", "Its step; 0 for none.", realism.thrust_quantum_m_s2, size);
  field("torque_limit_rad_s2", "Of an axis; 0 for none.", realism.torque_limit_rad_s2, size);
  field("torque_quantum_rad_s2", "Its step; 0 for none.", realism.torque_quantum_rad_s2, size);
  field("actuation_lag_s", "Time constant of thrust and torque; 0 for none.",
        realism.actuation_lag_s, range::between(0.0, 100.0));
  field("mass_kg", "Of the satellite.", realism.mass_kg, size);
  field("inertia_xx_kg_m2", "0 for no dynamics of rotation.", realism.inertia_kg_m2[0], size);
  field("inertia_yy_kg_m2", "Of the satellite.", realism.inertia_kg_m2[1], size);
  field("inertia_zz_kg_m2", "Of the satellite.", realism.inertia_kg_m2[2], size);
  field("inertia_xy_kg_m2", "Element of the tensor.", realism.inertia_products_kg_m2[0]);
  field("inertia_xz_kg_m2", "Element of the tensor.", realism.inertia_products_kg_m2[1]);
  field("inertia_yz_kg_m2", "Element of the tensor.", realism.inertia_products_kg_m2[2]);
  field("thrust_arm_x_m", "Place where thrust acts.", realism.thrust_arm_m[0]);
  field("thrust_arm_y_m", "From the centre of mass.", realism.thrust_arm_m[1]);
  field("thrust_arm_z_m", "In S.", realism.thrust_arm_m[2]);
  field.of_sensors("angular_scale_error", "Of its angular measurement.",
                   realism.angular_scale_error, range::between(-0.5, 0.5));
  field("angular_alignment", "Part of a sensor's misalignment in it.", realism.angular_alignment,
        range::between(0.0, 1.0));
  const Range slow = range::between(-1e-9, 1e-9);
  field.of_sensors("bias_drift_m_s3", "On each axis.", realism.bias_drift_m_s3, slow);
  field.of_sensors("scale_drift_per_s", "On each axis.", realism.scale_drift_per_s, slow);
}

template <typename Config, typename Visitor>
void visit_estimation(Config& estimation, Visitor& visit) {
  const TableFields field{"estimation", visit};
  field("method", "\"hardy2013\": one parameter a session, iterated; \"joint\": all at once.",
        estimation.method);
  field("correction", "\"hardy2013\" (the paper's), \"first_order\" or \"second_order\".",
        estimation.correction);
  field("transient_s", "Filtered record dropped at a session's start.", estimation.transient_s,
        range::not_negative);
  field("band_ratio", "Band-pass from f/ratio to f·ratio.", estimation.band_ratio,
        range::between(1.1, 20.0));
  field("convergence", "Done when estimates move by less, in objectives.", estimation.convergence,
        range::between(1e-12, 1.0));
  field("num_rounds_max", "Rounds at most.", estimation.num_rounds_max, range::between(1, 1000));
}

template <typename Config, typename Visitor>
void visit_tables(Config& scenario, Visitor& visit) {
  auto& acceptance = scenario.acceptance;
  const TableFields of_acceptance{"acceptance", visit};
  of_acceptance("a_d11_max", "Bound of |a_d11|.", acceptance.a_d11_max, range::positive);
  of_acceptance("a_d1j_max_rad", "Bound of |a_d12| and |a_d13|.", acceptance.a_d1j_max_rad,
                range::positive);
  of_acceptance("a_c1j_max_rad", "Bound of |a_c12| and |a_c13|.", acceptance.a_c1j_max_rad,
                range::positive);
  const TableFields of_objective{"objective", visit};
  const auto visit_objective = [&](const Quantity& quantity, auto& objective) {
    of_objective(quantity.column(), "Largest acceptable |error|.", objective, range::positive);
  };
  for (std::size_t i = 0; i < num_parameters; ++i) {
    visit_objective(microscope_results().quantities[i], scenario.objectives[i]);
  }
  for (std::size_t i = 0; scenario.has_tests() && i < num_test_objectives; ++i) {
    visit_objective(test_quantities()[i], scenario.test_objectives[i]);
  }
  auto& budget = scenario.budget;
  const TableFields of_budget{"budget", visit};
  of_budget("test_spin_rate_rad_s", "2π f_spin of the test, about Y; 0 is inertial.",
            budget.test_spin_rate_rad_s, range::between(-0.05, 0.05));
  of_budget("t_xy_s2", "T_xy at the test frequency.", budget.t_xy_s2, range::positive);
  of_budget("residual_m_s2", "Drag-free residue that no run tells.", budget.residual_m_s2,
            range::positive);
  of_budget("differential_m_s2", "Constant differential acceleration.", budget.differential_m_s2,
            range::positive);
  of_budget("offcentring_max_m", "Bound before calibration.", budget.offcentring_max_m,
            range::positive);
  of_budget("scale_factor_error_max", "Bound before calibration.", budget.scale_factor_error_max,
            range::positive);
  of_budget("quadratic_factor_max_s2_m", "Bound before calibration.",
            budget.quadratic_factor_max_s2_m, range::positive);
}

}  // namespace detail

template <typename Config, typename Visitor>
void for_each_field(Config& scenario, Visitor&& visit) {
  const detail::TableFields of_orbit{"orbit", visit};
  of_orbit("period_s", "Orbital period.", scenario.orbit.period_s,
           range::between(5000.0, 100000.0));
  of_orbit("eccentricity", "Perigee is on +X; files: at most 0.1, first order.",
           scenario.orbit.eccentricity, range::between(0.0, 0.5));
  const detail::TableFields of_simulation{"simulation", visit};
  of_simulation("sample_period_s", "Rate of instrument and control.",
                scenario.simulation.sample_period_s, range::between(0.05, 1.0));
  of_simulation("settling_s", "Loops run this long before a record begins.",
                scenario.simulation.settling_s,
                range::between(0.0, SimulationConfig::settling_max_s));
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
