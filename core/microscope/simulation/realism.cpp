#include "core/microscope/simulation/realism.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/math/eigen_vectors.hpp"
#include "core/math/elementary.hpp"

namespace proofmass {
namespace {

Vector3<double> vector(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

double actuated(double command, double limit, double quantum) {
  if (limit > 0.0) command = std::clamp(command, -limit, limit);
  return quantum > 0.0 ? quantum * std::nearbyint(command / quantum) : command;
}

}  // namespace

const Vector3<double>& Actuator::advance(const Vector3<double>& command) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double u = actuated(command[axis], limit, quantum);
    delivered[axis] = u + memory * (delivered[axis] - u);
  }
  return delivered;
}

Realism::Realism(const Scenario& scenario, const Instrument& instrument,
                 const LoopConstants<double>& constants, std::size_t session,
                 std::int64_t num_settling)
    : is_on_(scenario.realism.has_value()), next_(-num_settling) {
  for (const ControllerConfig& config : scenario.controllers) {
    controllers_.push_back(
        {config.loop, index(config.axis), {config, scenario.simulation.sample_period_s}});
  }
  if (!is_on_) return;
  config_ = *scenario.realism;
  at_start_ = constants;
  Eigen::Matrix3d angular = Eigen::Matrix3d::Zero();
  for (std::size_t k = 0; k < 2; ++k) {
    const Eigen::Matrix3d alignment_KS = instrument.sensors[k].alignment_KS();
    alignment_KS_[k] = matrix3(alignment_KS);
    const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
    angular += 0.5 * (1.0 + config_.angular_scale_error[k]) *
               (identity + config_.angular_alignment * (alignment_KS - identity));
  }
  angular_sensitivity_ = matrix3(angular);
  if (config_.has_inertia()) {
    const Eigen::Matrix3d inertia = config_.inertia_tensor_kg_m2();
    inertia_kg_m2_ = matrix3(inertia);
    inverse_inertia_ = matrix3(inertia.inverse());
  }
  orbit_period_s_ = scenario.orbit.period_s;
  sample_period_s_ = scenario.simulation.sample_period_s;
  for (std::size_t i = 0; i < session; ++i) {
    start_s_ += scenario.sessions[i].num_orbits * orbit_period_s_;
  }
  seen_S_rad_.resize(static_cast<std::size_t>(config_.star_tracker_latency_samples));
  const double memory = config_.actuation_memory(sample_period_s_);
  thrust_ = {config_.thrust_limit_m_s2, config_.thrust_quantum_m_s2, memory, {}};
  torque_ = {config_.torque_limit_rad_s2, config_.torque_quantum_rad_s2, memory, {}};
}

void Realism::begin_sample(LoopConstants<double>& constants) {
  if (!is_on_) return;
  const double t_s = start_s_ + static_cast<double>(next_++) * sample_period_s_;
  const double orbital = config_.star_tracker_orbital_error_rad *
                         sincos(2.0 * std::numbers::pi * std::fmod(t_s / orbit_period_s_, 1.0) +
                                config_.star_tracker_orbital_phase_rad)
                             .sine;
  constants.star_tracker_bias_S_rad =
      at_start_.star_tracker_bias_S_rad + Vector3<double>{orbital, orbital, orbital};
  for (std::size_t k = 0; k < 2; ++k) {
    const SensorModel<double>& at_start = at_start_.sensors[k];
    SensorModel<double>& sensor = constants.sensors[k];
    const double bias = config_.bias_drift_m_s3[k] * t_s;
    const double scale = config_.scale_drift_per_s[k] * t_s;
    sensor.offset_K_m_s2 = at_start.offset_K_m_s2 + Vector3<double>{bias, bias, bias} -
                           scale * at_start.parasitic_K_m_s2;
    for (std::size_t i = 0; i < 3; ++i) {
      sensor.sensitivity_KS.row[i] =
          at_start.sensitivity_KS.row[i] + scale * alignment_KS_[k].row[i];
    }
  }
}

Vector3<double> Realism::seen(const Vector3<double>& angle_RS_S) {
  if (seen_S_rad_.empty()) return angle_RS_S;
  const Vector3<double> old = std::exchange(seen_S_rad_[oldest_], angle_RS_S);
  oldest_ = (oldest_ + 1) % seen_S_rad_.size();
  return old;
}

void Realism::steer(const Vector3<double>& input_S, const Vector3<double>& angle_RS_S,
                    Vector3<double>& thrust_S, Vector3<double>& torque_S) {
  for (auto& [loop, axis, law] : controllers_) {
    if (loop == ControlLoop::drag_free) {
      thrust_S[axis] = law.advance(input_S[axis]);
    } else {
      torque_S[axis] = -law.advance(angle_RS_S[axis]);
    }
  }
}

void Realism::actuate(const LoopConstants<double>& constants, const Vector3<double>& omega_IS_S,
                      Vector3<double>& thrust_S, Vector3<double>& torque_S) {
  if (!is_on_) return;
  thrust_S = thrust_.advance(thrust_S);
  torque_S = torque_.advance(torque_S);
  if (!config_.has_inertia()) return;
  const Vector3<double> force_N = -config_.mass_kg * (constants.thrust_matrix * thrust_S);
  const Vector3<double> torque_Nm = scaled(vector(config_.inertia_kg_m2), torque_S) -
                                    cross(omega_IS_S, inertia_kg_m2_ * omega_IS_S) +
                                    cross(vector(config_.thrust_arm_m), force_N);
  torque_S = inverse_inertia_ * torque_Nm;
}

}  // namespace proofmass
