#include "core/microscope/campaign/shift_bounds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/math/elementary.hpp"
#include "core/microscope/campaign/regressor_lines.hpp"
#include "core/microscope/instrument/drawn_sizes.hpp"
#include "core/microscope/instrument/stiffness.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"
#include "core/signal/line_weights.hpp"
#include "core/signal/noise_shape.hpp"

namespace proofmass {
namespace {

constexpr double turn_rad = 2.0 * std::numbers::pi;

/// Without noise the quadratic terms still change a little from block to block: as noise of less
/// than this, m/s²/√Hz. The largest of them is 2 K2d b_1d Γ_app,d with 2 K2d b_1d ≤ 4e-4 and lines
/// of Γ_app,d of ½·1.7e-6 s⁻² × 20 µm along two axes: A = 9e-15 m/s². The steps of a line between
/// blocks of n samples are at most those of white noise of density A √(nT), 2.1e-13. Noise of the
/// density below moves a_c11Δx by 1.5 nm in ten orbits (one standard deviation).
constexpr double quiet_asd_m_s2 = 3e-13;

// Bounds of construction, [Hardy2013] tab:Budget and core/microscope/instrument.
constexpr double centre_offset_max_m = 1e-3;  // Of the unit from its place, each axis.
constexpr double coupling_max_rad = 1e-4;     // η.

/// The parameter that a session of each target helps to find; the two slopes of K2c have one.
constexpr std::array<Parameter, index(SessionTarget::no_target)> found_parameters{
    Parameter::a_c11_delta_x,
    Parameter::a_c11_delta_z,
    Parameter::a_c11_delta_y,
    Parameter::a_c12,
    Parameter::a_c13,
    Parameter::a_d11_prime,
    Parameter::a_d12,
    Parameter::a_d13,
    Parameter::k2d,
    Parameter::k2c,
    Parameter::k2c};

Parameter parameter_of(SessionTarget target) { return found_parameters[index(target)]; }

double mean_motion_rad_s(const Scenario& scenario) { return turn_rad / scenario.orbit.period_s; }

double square(double x) { return x * x; }

/// Γ_mes,cx at 2 f_EP that the loop leaves of [T] r_c, with r_c at its bound along X and Z, m/s².
double gradient_residual(const Scenario& scenario, const Session& session) {
  const double n = mean_motion_rad_s(scenario);
  const std::array<double, 3>& place = scenario.sensor.position_m;
  const double frequency_hz =
      std::max(2.0 * test_frequency_hz(session, scenario.orbit.period_s), 1e-9);
  return std::abs(drag_free_sensitivity(scenario.drag_free, frequency_hz)) * 1.5 * n * n *
         std::numbers::sqrt2 *
         (centre_offset_max_m + std::max(std::abs(place[0]), std::abs(place[2])));
}

/// Γ_mes,cx at 2 f_EP that is known beforehand: gradient_residual() and the drag's own line, m/s².
double known_line(const Scenario& scenario, const Session& session) {
  const double line = gradient_residual(scenario, session);
  if (scenario.environment.kind != EnvironmentKind::harmonic) return line;
  const double drag = scenario.environment.scale * scenario.environment.linear_x.twice_orbital;
  const double frequency_hz = 2.0 / scenario.orbit.period_s;
  return line + drag * std::abs(drag_free_sensitivity(scenario.drag_free, frequency_hz));
}

/// A line A cos ωt has blocks of the length T whose means step by 2A sin x sinc x, x = ½ωT. That is
/// twice this share of A²T as a density.
double step_share(double frequency_hz, double block_s) {
  const double x = 0.5 * turn_rad * frequency_hz * block_s;
  const double sine = sincos(x).sine;
  return square(sine * sine / x);
}

/// What is left of a disturbance that is a quarter of a turn away from the regressor at two lines,
/// with opposite signs: the difference of the weights with which the band-pass passes them.
double asymmetry(const Scenario& scenario, const Session& session) {
  if (session.fit_lines.size() != 2) return 1.0;
  const auto weight = [&](std::size_t i) {
    return band_gain_squared(
        scenario, session,
        line_frequency_hz(session, session.fit_lines[i], scenario.orbit.period_s));
  };
  return std::abs(weight(0) - weight(1)) / (weight(0) + weight(1));
}

/// |k/m| of the sensor that has the larger one, where a session feels it.
double stiffness_s2(const Scenario& scenario, const Session& session) {
  if (!feels_stiffness(scenario.sensor, session)) return 0.0;
  const auto& [first, second] = scenario.sensor.radial_stiffness_s2;
  return std::max(std::abs(first), std::abs(second));
}

const Session* first_of(const Scenario& scenario, SessionTarget target) {
  const auto found = std::ranges::find(scenario.sessions, target, &Session::target);
  return found == scenario.sessions.end() ? nullptr : &*found;
}

}  // namespace

std::string_view name_of(Effect effect) {
  static constexpr std::array<std::string_view, num_effects> names{
      "residual", "attitude", "quadratic_noise", "square_noise", "spin"};
  return names[static_cast<std::size_t>(effect)];
}

SessionTarget finding_session(Parameter parameter) {
  const auto found = std::ranges::find(found_parameters, parameter);
  return static_cast<SessionTarget>(found - found_parameters.begin() + 1);
}

double least_noise_density(const Scenario& scenario) {
  double least = std::numeric_limits<double>::max();
  for (const Session& session : scenario.sessions) {
    for (const LineMultiple& line : session.fit_lines) {
      const double frequency_hz = line_frequency_hz(session, line, scenario.orbit.period_s);
      least = std::min(least, differential_x_psd(scenario.noise, frequency_hz));
    }
  }
  const double scale = scenario.noise.scale;
  return std::max(scale * scale * least, quiet_asd_m_s2 * quiet_asd_m_s2);
}

/// Collects shifts of one run.
class ShiftBounds::Sum {
 public:
  Sum(const ShiftBounds& bounds, std::span<const double> truth,
      std::span<const double> standard_errors)
      : bounds_(bounds), truth_(truth), standard_errors_(standard_errors) {}

  /// |truth| of a parameter, SI.
  double operator[](Parameter parameter) const { return std::abs(truth_[index(parameter)]); }

  [[nodiscard]] bool has_standard_errors() const { return !standard_errors_.empty(); }
  [[nodiscard]] Sensitivity sensitivity(Parameter parameter) const {
    return has_standard_errors() ? bounds_.sensitivity(standard_errors_[index(parameter)])
                                 : bounds_.of(parameter);
  }

  void add(Effect effect, Parameter parameter, double shift, double part_of_loss = 1.0) {
    if (!(shift > 0.0)) return;
    const double part = shift / bounds_.objectives_[index(parameter)];
    shifts.push_back({effect, parameter, part, part_of_loss});
  }

  /// Three standard deviations of an effect that is noise. A run is lost by it where it is beyond
  /// both the objective and what the noise of the sensors explains, six standard deviations.
  void add_noise(Effect effect, Parameter parameter, double shift) {
    const double explained = 6.0 * sensitivity(parameter).sensor_sigma;
    add(effect, parameter, shift, std::max(1.0, explained / bounds_.objectives_[index(parameter)]));
  }

  std::vector<Shift> shifts;

 private:
  const ShiftBounds& bounds_;
  std::span<const double> truth_;
  std::span<const double> standard_errors_;
};

ShiftBounds::ShiftBounds(const Scenario& scenario, const DispersionSet& dispersions)
    : objectives_(scenario.objectives),
      least_density_(least_noise_density(scenario)),
      block_s_(LineWeights::block_size * scenario.simulation.sample_period_s),
      white_density_(differential_x_density(
          scenario.noise, [](const SensorNoise& x) { return square(x.white_asd); })),
      duration_s_(0.0),
      // b_1d is half the difference of both sensors' p along X.
      differential_bias_m_s2_(DrawnSizes(dispersions).of_pair("parasitic_acceleration_m_s2", 0)),
      has_noise_(scenario.noise.scale > 0.0),
      gradient_line_s2_(0.75 * square(mean_motion_rad_s(scenario))),
      delta_per_m_s2_(2.0 / (square(mean_motion_rad_s(scenario)) *
                             KeplerOrbit(scenario.orbit).semi_latus_rectum_m())),
      delta_objective_(scenario.test_objectives[index(TestParameter::eotvos_parameter)]) {
  if (has_noise_) white_density_ *= square(scenario.noise.scale);
  for (const Session& session : scenario.sessions) {
    if (is_test(session)) continue;
    duration_s_ += fit_duration_s(scenario, session);
    if (session.excitations.empty()) {
      const double frequency_hz = 2.0 * test_frequency_hz(session, scenario.orbit.period_s);
      known_line_m_s2_ = std::max(known_line_m_s2_, known_line(scenario, session));
      step_share_ = std::max(step_share_, step_share(std::max(frequency_hz, 1e-9), block_s_));
    }
    for (const Excitation* const motion : mass_excitations(session)) {
      if (motion == nullptr) continue;
      double& largest = mass_acceleration_m_s2_[index(motion->axis)];
      const double per_metre =
          square(turn_rad * motion->frequency_hz) + stiffness_s2(scenario, session);
      largest = std::max(largest, per_metre * motion->amplitude);
    }
    if (session.target == SessionTarget::no_target) continue;
    add_session(scenario, session);
    add_spin(scenario, session);
    if (session.target != SessionTarget::a_d11_prime) continue;
    const double turns = fit_duration_s(scenario, session) / scenario.orbit.period_s;
    of_sidebands_ = std::max(of_sidebands_, 2.0 / (std::numbers::pi * turns));
  }
}

void ShiftBounds::add_session(const Scenario& scenario, const Session& session) {
  const std::vector<double> amplitudes =
      fitted_amplitudes(scenario, session, regressor_lines(scenario, session));
  double sum = 0.0;
  double squares = 0.0;
  for (const double amplitude : amplitudes) {
    sum += amplitude;
    squares += amplitude * amplitude;
  }
  Sensitivity& total = sensitivities_[index(parameter_of(session.target))];
  const bool is_half = parameter_of(session.target) == Parameter::k2c;  // The mean of two slopes.
  const double scale = std::abs(target_info(session.target).scale) * (is_half ? 0.5 : 1.0);
  total.of_line = std::max(total.of_line, scale * sum / squares);
  const double of_noise = scale / std::sqrt(squares * fit_duration_s(scenario, session));
  // The larger standard error of several sessions is a bound; of two slopes the errors add up.
  total.of_noise = is_half ? std::sqrt(square(total.of_noise) + square(of_noise))
                           : std::max(total.of_noise, of_noise);
  const double frequency_hz =
      line_frequency_hz(session, session.fit_lines.front(), scenario.orbit.period_s);
  total.sensor_sigma = total.of_noise * scenario.noise.scale *
                       std::sqrt(differential_x_psd(scenario.noise, frequency_hz));
}

// A fit with the weights W of its lines and the Jacobian J moves by C Jᵀ W δ if its lines move by
// δ. By Schwarz's inequality that is σ √(δᵀWδ) at most, because C ≥ C JᵀWJ C. Two lines of each
// session move by 1 m/s² at most.
ShiftBounds::Sensitivity ShiftBounds::sensitivity(double standard_error) const {
  return {.of_line = standard_error * std::sqrt(2.0 * duration_s_ / white_density_),
          .of_noise = standard_error / std::sqrt(white_density_),
          .sensor_sigma = has_noise_ ? standard_error : 0.0};
}

void ShiftBounds::add_spin(const Scenario& scenario, const Session& session) {
  using enum SessionTarget;
  const double spin = session.spin_rate_rad_s;
  double& bound = of_spin_[index(parameter_of(session.target))];
  const double of_line = of(parameter_of(session.target)).of_line;
  if (session.target == a_d11_prime) {
    bound = std::max(bound, spin * spin + 0.5 * square(mean_motion_rad_s(scenario)));
  } else if (session.target == a_c13) {
    const Excitation& motion = *mass_excitation(session);
    const double coriolis_m_s2 = std::abs(spin) * turn_rad * motion.frequency_hz * motion.amplitude;
    bound = std::max(bound, of_line * gradient_residual(scenario, session) * coriolis_m_s2 *
                                asymmetry(scenario, session));
  } else if (session.target == a_c11_delta_x || session.target == a_c11_delta_z) {
    // â_d11' holds the centrifugal acceleration of its own session.
    const Session* const other = first_of(scenario, a_d11_prime);
    const double of_other = other == nullptr ? 0.0 : other->spin_rate_rad_s;
    bound = std::max(bound, of_line * gradient_residual(scenario, session) *
                                std::abs(spin * spin - of_other * of_other));
  }
}

void ShiftBounds::add_residual(double residual_m_s2, Sum& sum) const {
  using enum Parameter;
  // Lines of the residual are at most twice as large as that at f_EP, or known.
  const double line_m_s2 = std::max(2.0 * residual_m_s2, known_line_m_s2_);
  const double square_m_s2 = 0.5 * sum[k2d] * line_m_s2 * line_m_s2;
  for (const Parameter delta : {a_c11_delta_x, a_c11_delta_z}) {
    sum.add(Effect::residual, delta, sum.sensitivity(delta).of_line * square_m_s2);
  }
  sum.add(Effect::residual, a_d11_prime, of_sidebands_ * sum[k2d] * line_m_s2);
  const auto add_product = [&](Axis axis, Parameter common, Parameter differential) {
    const double along_x = 0.5 * mass_acceleration_m_s2_[index(axis)] *
                           (sum[k2c] * (sum[common] + coupling_max_rad) +
                            sum[k2d] * (sum[differential] + coupling_max_rad));
    sum.add(Effect::residual, common, sum.sensitivity(common).of_line * line_m_s2 * along_x);
  };
  add_product(Axis::y, a_c12, a_d12);
  add_product(Axis::z, a_c13, a_d13);
}

void ShiftBounds::add_noises(const LoopHealth& health, Sum& sum) const {
  using enum Parameter;
  constexpr double num_deviations = 3.0;
  // Lines times the constant b_1d, which a_d11' and a_c11 take up, look like noise too: those of
  // the residual with K2c, and with K2d that of the gradient in Γ_App,dx.
  const double twice_bias_m_s2 = 2.0 * differential_bias_m_s2_;
  const double gradient_line_m_s2 =
      gradient_line_s2_ * std::sqrt(square(sum[a_c11_delta_x]) + square(sum[a_c11_delta_z]));
  const double of_residual = twice_bias_m_s2 * sum[k2c] * health.residual_m_s2;
  const double of_known =
      twice_bias_m_s2 * (sum[k2c] * known_line_m_s2_ + sum[k2d] * gradient_line_m_s2);
  const double of_lines = 2.0 * block_s_ * (square(of_residual) + step_share_ * square(of_known));
  const double density = std::max(0.0, health.quadratic_noise * least_density_ - of_lines);
  for (std::size_t p = 0; p < num_parameters; ++p) {
    const auto parameter = static_cast<Parameter>(p);
    sum.add_noise(Effect::quadratic_noise, parameter,
                  num_deviations * std::sqrt(density) * sum.sensitivity(parameter).of_noise);
  }
  const double x = num_deviations * std::sqrt(0.5 * health.square_noise);
  const double relative =
      x < 1.0 ? x / (1.0 - x) : std::numeric_limits<double>::infinity();  // Of 1/(1 − x).
  const double of_k2 = x == 0.0 ? 0.0 : relative;
  sum.add_noise(Effect::square_noise, k2d, of_k2 * (sum[k2d] + sum[a_d11_prime] * sum[k2c]));
  // The mean of two slopes, whose noises are independent.
  sum.add_noise(Effect::square_noise, k2c,
                of_k2 * std::sqrt(0.5 * (square(sum[k2c]) + square(sum[k2d]))));
}

std::vector<Shift> ShiftBounds::of(const LoopHealth& health, std::span<const double> truth,
                                   std::span<const double> standard_errors) const {
  using enum Parameter;
  Sum sum(*this, truth, standard_errors);
  add_residual(health.residual_m_s2, sum);
  const double tilt_rad = health.attitude_rad * health.attitude_rad;
  sum.add(Effect::attitude, a_c12, tilt_rad);
  sum.add(Effect::attitude, a_c13, tilt_rad);
  const double tilted_m =
      3.0 * tilt_rad * (sum[a_c11_delta_x] + sum[a_c11_delta_y] + sum[a_c11_delta_z]);
  sum.add(Effect::attitude, a_c11_delta_x, tilted_m);
  sum.add(Effect::attitude, a_c11_delta_z, tilted_m);
  add_noises(health, sum);
  if (sum.has_standard_errors()) return std::move(sum.shifts);  // Its sessions do not spin.
  sum.add(Effect::spin, a_d11_prime, of_spin_[index(a_d11_prime)] * sum[k2c] * sum[a_c11_delta_x]);
  sum.add(Effect::spin, a_c13, of_spin_[index(a_c13)] * sum[k2c]);
  for (const Parameter delta : {a_c11_delta_x, a_c11_delta_z}) {
    sum.add(Effect::spin, delta, of_spin_[index(delta)] * sum[k2c] * sum[a_c11_delta_x]);
  }
  return std::move(sum.shifts);
}

double ShiftBounds::part_of_test(const Shift& shift, double test_residual_m_s2) const {
  using enum Parameter;
  const Parameter parameter = shift.parameter;
  if (parameter != a_d11_prime && parameter != a_d12 && parameter != a_d13) return 0.0;
  return shift.part * objectives_[index(parameter)] * delta_per_m_s2_ * test_residual_m_s2 /
         delta_objective_;
}

}  // namespace proofmass
