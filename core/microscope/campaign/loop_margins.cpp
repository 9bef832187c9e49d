#include "core/microscope/campaign/loop_margins.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <complex>
#include <cstddef>
#include <optional>

#include "core/math/elementary.hpp"
#include "core/microscope/control/control_loops.hpp"

namespace proofmass {
namespace {

using Complex = std::complex<double>;

constexpr std::array axes{Axis::x, Axis::y, Axis::z};

/// Nothing where the controller is the nominal one.
std::optional<SampledController> controller_of(const Scenario& scenario, ControlLoop loop,
                                               Axis axis) {
  for (const ControllerConfig& config : scenario.controllers) {
    if (config.loop != loop || config.axis != axis) continue;
    return SampledController(config, scenario.simulation.sample_period_s);
  }
  return std::nullopt;
}

/// y/u of an Actuator in its linear range.
Complex actuator_response(const Scenario& scenario, const Complex& z_inverse) {
  if (!scenario.realism || scenario.realism->actuation_lag_s == 0.0) return 1.0;
  const double memory =
      exponential(-scenario.simulation.sample_period_s / scenario.realism->actuation_lag_s);
  return (1.0 - memory) / (1.0 - memory * z_inverse);
}

AxisMargins drag_free_margins(const Scenario& scenario, const Instrument& instrument,
                              DragFreeSource source, Axis axis) {
  const auto a = static_cast<Eigen::Index>(index(axis));
  const DragFreeGains gains =
      drag_free_gains(scenario.drag_free, scenario.simulation.sample_period_s);
  const auto own = controller_of(scenario, ControlLoop::drag_free, axis);
  double factor = 0.0;
  for (std::size_t k = 0; k < 2; ++k) {
    factor += drag_free_weights(source)[k] * instrument.sensors[k].sensitivity_KS()(a, a);
  }
  factor *= instrument.thrust_matrix(a, a);
  const auto open_loop = [&](const Complex& z_inverse) {
    const Complex sum = 1.0 / (1.0 - z_inverse);
    const Complex controller =
        own ? own->response(z_inverse) : gains.proportional * sum * (1.0 + gains.integral * sum);
    return factor * z_inverse * controller * actuator_response(scenario, z_inverse);
  };
  return {ControlLoop::drag_free, axis, margins_of(open_loop)};
}

/// What AttitudeEstimator makes of an angular acceleration α, over α.
struct EstimatedMotion {
  Complex angle_s2;  ///< θ̂.
  Complex rate_s;    ///< Its rate.
};

/// @param seen_s2   The star tracker's angle over α.
/// @param measured  The measured acceleration over α.
EstimatedMotion estimated_motion(const AttitudeGains& gains, const Complex& z_inverse,
                                 const Complex& seen_s2, double measured) {
  const double period = gains.sample_period_s, half_square = 0.5 * period * period;
  Eigen::Matrix3d predict;
  predict << 1.0, period, -half_square, 0.0, 1.0, -period, 0.0, 0.0, 1.0;
  const Eigen::Vector3d correct(gains.blend_angle, gains.blend_rate_per_s,
                                -gains.blend_bias_per_s2);
  Eigen::Matrix3d remains = Eigen::Matrix3d::Identity();
  remains.col(0) -= correct;
  const Eigen::Vector3cd drive = (predict * correct).cast<Complex>() * seen_s2 +
                                 Eigen::Vector3cd(half_square, period, 0.0) * measured;
  const Eigen::Matrix3cd system = Eigen::Matrix3cd(Eigen::Matrix3cd::Identity()) / z_inverse -
                                  (predict * remains).cast<Complex>();
  const Eigen::Vector3cd predicted = system.partialPivLu().solve(drive);
  const Eigen::Vector3cd estimate =
      remains.cast<Complex>() * predicted + correct.cast<Complex>() * seen_s2;
  return {estimate[0], estimate[1]};
}

AxisMargins attitude_margins(const Scenario& scenario, Axis axis) {
  const auto a = static_cast<Eigen::Index>(index(axis));
  const double period = scenario.simulation.sample_period_s;
  const AttitudeGains gains = attitude_gains(scenario.attitude, period);
  const auto own = controller_of(scenario, ControlLoop::attitude, axis);
  const RealismConfig realism = scenario.realism.value_or(RealismConfig{});
  const auto latency = static_cast<int>(realism.star_tracker_latency_samples);
  const double measured =
      1.0 + 0.5 * (realism.angular_scale_error[0] + realism.angular_scale_error[1]);
  double factor = 1.0;
  if (realism.has_inertia()) {
    const Eigen::Matrix3d inertia = realism.inertia_tensor_kg_m2();
    factor = Eigen::Matrix3d(inertia.inverse())(a, a) * inertia(a, a);
  }
  const auto open_loop = [&](const Complex& z_inverse) {
    const Complex sum = 1.0 / (1.0 - z_inverse);
    const Complex angle = 0.5 * period * period * z_inverse * (1.0 + z_inverse) * sum * sum;
    const auto [angle_s2, rate_s] =
        estimated_motion(gains, z_inverse, angle * std::pow(z_inverse, latency), measured);
    const Complex nominal =
        (gains.stiffness_per_s2 + gains.integral_per_s3 * period * sum) * angle_s2 +
        gains.damping_per_s * rate_s;
    const Complex command = own ? own->response(z_inverse) * angle_s2 : nominal;
    return factor * z_inverse * command * actuator_response(scenario, z_inverse);
  };
  return {ControlLoop::attitude, axis, margins_of(open_loop)};
}

}  // namespace

std::vector<AxisMargins> loop_margins(const Scenario& scenario, const Instrument& instrument) {
  std::vector<AxisMargins> all;
  for (const Axis axis : axes) all.push_back(attitude_margins(scenario, axis));
  for (const auto source :
       {DragFreeSource::common, DragFreeSource::sensor_1, DragFreeSource::sensor_2}) {
    const auto has_it = [&](const Session& session) { return session.drag_free == source; };
    if (std::ranges::none_of(scenario.sessions, has_it)) continue;
    for (const Axis axis : axes) {
      all.push_back(drag_free_margins(scenario, instrument, source, axis));
    }
  }
  return all;
}

Margins least(const std::vector<AxisMargins>& of_axes) {
  Margins margins = of_axes.front().margins;
  for (const AxisMargins& of : of_axes) {
    margins.gain = std::min(margins.gain, of.margins.gain);
    margins.phase_rad = std::min(margins.phase_rad, of.margins.phase_rad);
  }
  return margins;
}

}  // namespace proofmass
