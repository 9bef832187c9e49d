#include "core/microscope/campaign/loop_margins.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "core/math/complex.hpp"

namespace proofmass {
namespace {

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
ComplexDouble actuator_response(const Scenario& scenario, ComplexDouble z_inverse) {
  if (!scenario.realism) return 1.0;
  const double memory = scenario.realism->actuation_memory(scenario.simulation.sample_period_s);
  return (1.0 - memory) / (1.0 - memory * z_inverse);
}

/// What a Resonator multiplies the loop's input by.
ComplexDouble response(const ResonatorGains& gains, ComplexDouble z_inverse) {
  const ComplexDouble turned = gains.cosine * z_inverse;
  return 1.0 + gains.input * (1.0 - turned) / (1.0 - 2.0 * turned + z_inverse * z_inverse);
}

AxisMargins drag_free_margins(const Scenario& scenario, const Instrument& instrument,
                              const Session& session, Axis axis) {
  const auto a = static_cast<Eigen::Index>(index(axis));
  const DragFreeGains gains =
      drag_free_gains(scenario.drag_free, scenario.simulation.sample_period_s);
  const auto own = controller_of(scenario, ControlLoop::drag_free, axis);
  const ResonatorGains resonator = resonator_in(scenario, session);
  double factor = 0.0;
  for (std::size_t k = 0; k < 2; ++k) {
    factor +=
        drag_free_weights(session.drag_free)[k] * instrument.sensors[k].sensitivity_KS()(a, a);
  }
  factor *= instrument.thrust_matrix(a, a);
  const auto open_loop = [&](ComplexDouble z_inverse) {
    const ComplexDouble sum = 1.0 / (1.0 - z_inverse);
    const ComplexDouble controller =
        own ? own->response(z_inverse) : gains.proportional * sum * (1.0 + gains.integral * sum);
    const ComplexDouble loop =
        factor * z_inverse * controller * actuator_response(scenario, z_inverse);
    return resonator.input == 0.0 ? loop : loop * response(resonator, z_inverse);
  };
  Resonances resonances = own ? own->resonances() : Resonances();
  if (resonator.input != 0.0) resonances.poles.emplace_back(resonator.cosine, resonator.sine);
  return {ControlLoop::drag_free, axis, margins_of(open_loop, resonances),
          resonator.input == 0.0 ? "" : session.name};
}

/// What AttitudeEstimator makes of an angular acceleration α, over α.
struct EstimatedMotion {
  ComplexDouble angle_s2;  ///< θ̂.
  ComplexDouble rate_s;    ///< Its rate.
};

/// The estimator's recursion solved for its innovation ν: with D = z − 1 and P what two sums make
/// of a measured α,
///
///     ν = (seen − P·measured)/(1 + (g + h T z/D)/D + k P z/D),    θ̂ = seen − (1 − g) ν
///
/// @param seen_s2      The star tracker's angle over α.
/// @param measured     The measured acceleration over α.
/// @param integral_s2  P.
EstimatedMotion estimated_motion(const AttitudeGains& gains, ComplexDouble z_inverse,
                                 ComplexDouble seen_s2, double measured,
                                 ComplexDouble integral_s2) {
  const double period = gains.sample_period_s;
  const ComplexDouble next = 1.0 / (1.0 - z_inverse);  // z/D.
  const ComplexDouble past = z_inverse * next;         // 1/D.
  const ComplexDouble weight = 1.0 +
                               past * (gains.blend_angle + gains.blend_rate_per_s * period * next) +
                               gains.blend_bias_per_s2 * (integral_s2 * next);
  const ComplexDouble innovation = (seen_s2 - measured * integral_s2) / weight;
  const ComplexDouble bias = gains.blend_bias_per_s2 * (next * innovation);
  return {seen_s2 - (1.0 - gains.blend_angle) * innovation,
          gains.blend_rate_per_s * (next * innovation) + period * (past * (measured + bias))};
}

ComplexDouble delayed(ComplexDouble value, ComplexDouble z_inverse, std::int64_t num_samples) {
  for (std::int64_t i = 0; i < num_samples; ++i) value = value * z_inverse;
  return value;
}

/// The least and the largest eigenvalue of [J]⁻¹ diag[J], by which products of inertia change the
/// loop's gain: with one controller on all axes, that of the modes that they couple. 1 alone if
/// there are none.
std::vector<double> extreme_mode_gains(const RealismConfig& realism) {
  if (!realism.has_inertia()) return {1.0};
  const Eigen::Matrix3d inertia = realism.inertia_tensor_kg_m2();
  const Eigen::Vector3d roots = inertia.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::Vector3d scaled = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(
                                     roots.asDiagonal() * inertia * roots.asDiagonal())
                                     .eigenvalues();
  return {1.0 / scaled[2], 1.0 / scaled[0]};
}

AxisMargins attitude_margins(const Scenario& scenario, Axis axis) {
  const double period = scenario.simulation.sample_period_s;
  const AttitudeGains gains = attitude_gains(scenario.attitude, period);
  const auto own = controller_of(scenario, ControlLoop::attitude, axis);
  const RealismConfig realism = scenario.realism.value_or(RealismConfig{});
  const double measured =
      1.0 + 0.5 * (realism.angular_scale_error[0] + realism.angular_scale_error[1]);
  const auto open_loop = [&](ComplexDouble z_inverse) {
    const ComplexDouble sum = 1.0 / (1.0 - z_inverse);
    const ComplexDouble angle = 0.5 * period * period * (z_inverse * (1.0 + z_inverse) * sum * sum);
    const ComplexDouble seen = delayed(angle, z_inverse, realism.star_tracker_latency_samples);
    const auto [angle_s2, rate_s] = estimated_motion(gains, z_inverse, seen, measured, angle);
    const ComplexDouble nominal =
        (gains.stiffness_per_s2 + gains.integral_per_s3 * period * sum) * angle_s2 +
        gains.damping_per_s * rate_s;
    const ComplexDouble command = own ? own->response(z_inverse) * angle_s2 : nominal;
    return z_inverse * command * actuator_response(scenario, z_inverse);
  };
  std::vector<AxisMargins> of_modes;
  for (const double factor : extreme_mode_gains(realism)) {
    const auto of_mode = [&](ComplexDouble z_inverse) { return factor * open_loop(z_inverse); };
    of_modes.push_back({ControlLoop::attitude,
                        axis,
                        margins_of(of_mode, own ? own->resonances() : Resonances()),
                        {}});
  }
  return {ControlLoop::attitude, axis, least(of_modes), {}};
}

// A controller in s: coefficients of 1, s, s² ...
using Polynomial = std::vector<double>;
struct RationalController {
  Polynomial numerator, denominator;
};

Polynomial with_roots(const std::vector<std::complex<double>>& roots, double leading) {
  std::vector<std::complex<double>> coefficients{leading};
  for (const std::complex<double>& root : roots) {
    coefficients.push_back(0.0);
    for (std::size_t i = coefficients.size(); i-- > 0;) {
      coefficients[i] = (i > 0 ? coefficients[i - 1] : 0.0) - root * coefficients[i];
    }
  }
  Polynomial real;
  for (const std::complex<double>& coefficient : coefficients) real.push_back(coefficient.real());
  return real;
}

RationalController rational_controller(const Scenario& scenario, ControlLoop loop, Axis axis) {
  constexpr double turn_rad = 2.0 * std::numbers::pi;
  for (const ControllerConfig& own : scenario.controllers) {
    if (own.loop != loop || own.axis != axis) continue;
    return {with_roots(own.zeros_rad_s, own.gain), with_roots(own.poles_rad_s, 1.0)};
  }
  if (loop == ControlLoop::drag_free) {
    const double crossover = turn_rad * scenario.drag_free.bandwidth_hz;
    return {{crossover * turn_rad * scenario.drag_free.integral_hz, crossover}, {0.0, 0.0, 1.0}};
  }
  const AttitudeConfig& attitude = scenario.attitude;
  const double omega = turn_rad * attitude.bandwidth_hz;
  return {{omega * omega * turn_rad * attitude.integral_hz, omega * omega,
           2.0 * attitude.damping * omega},
          {0.0, 1.0}};
}

/// Least |Re s| of the zeros of a polynomial.
double slowest_rate(const Polynomial& polynomial) {
  const auto degree = static_cast<Eigen::Index>(polynomial.size()) - 1;
  if (degree == 0) return std::numeric_limits<double>::infinity();
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(degree, degree);
  companion.diagonal(-1).setOnes();
  for (Eigen::Index i = 0; i < degree; ++i) {
    companion(i, degree - 1) = -polynomial[static_cast<std::size_t>(i)] / polynomial.back();
  }
  return companion.eigenvalues().real().cwiseAbs().minCoeff();
}

/// Of 1 + C/(1 + s·lag) along an axis of the drag-free loop, and of 1 + C/((1 + s·lag) s²) about
/// one of the attitude loop.
double slowest_rate(const Scenario& scenario, ControlLoop loop, Axis axis) {
  auto [closed, denominator] = rational_controller(scenario, loop, axis);
  while (closed.front() == 0.0 && denominator.front() == 0.0) {  // An integral that is left out.
    closed.erase(closed.begin());
    denominator.erase(denominator.begin());
  }
  if (loop == ControlLoop::attitude) denominator.insert(denominator.begin(), 2, 0.0);
  const double lag_s = scenario.realism ? scenario.realism->actuation_lag_s : 0.0;
  closed.resize(denominator.size() + (lag_s > 0.0 ? 1 : 0));
  for (std::size_t i = 0; i < denominator.size(); ++i) {
    closed[i] += denominator[i];
    if (lag_s > 0.0) closed[i + 1] += lag_s * denominator[i];
  }
  return slowest_rate(closed);
}

}  // namespace

double slowest_decay_s(const Scenario& scenario) {
  double rate = 2.0 * std::numbers::pi * scenario.attitude.blending_hz;
  for (const Axis axis : axes) {
    for (const ControlLoop loop : {ControlLoop::drag_free, ControlLoop::attitude}) {
      rate = std::min(rate, slowest_rate(scenario, loop, axis));
    }
  }
  return 1.0 / rate;
}

ResonatorGains resonator_in(const Scenario& scenario, const Session& session) {
  const double damping = scenario.drag_free.resonator_damping;
  if (!is_test(session) || damping == 0.0) return {};
  return resonator_gains(damping, test_frequency_hz(session, scenario.orbit.period_s),
                         scenario.simulation.sample_period_s);
}

std::vector<AxisMargins> loop_margins(const Scenario& scenario, const Instrument& instrument) {
  std::vector<AxisMargins> all;
  for (const Axis axis : axes) all.push_back(attitude_margins(scenario, axis));
  for (const auto source :
       {DragFreeSource::common, DragFreeSource::sensor_1, DragFreeSource::sensor_2}) {
    std::vector<double> sines;  // Of the resonators that the loop has; 0: none.
    for (const Session& session : scenario.sessions) {
      const double sine = resonator_in(scenario, session).sine;
      if (session.drag_free != source || std::ranges::count(sines, sine) > 0) continue;
      sines.push_back(sine);
      for (const Axis axis : axes) {
        all.push_back(drag_free_margins(scenario, instrument, session, axis));
      }
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
