#include "core/microscope/simulation/run_health.hpp"

#include <algorithm>
#include <cmath>

#include "core/campaign/run_result.hpp"
#include "core/error.hpp"
#include "core/microscope/campaign/regressor_lines.hpp"
#include "core/microscope/estimation/ep_test/ep_test.hpp"
#include "core/microscope/estimation/methods.hpp"
#include "core/microscope/simulation/line_fit.hpp"
#include "core/microscope/simulation/session_signals.hpp"
#include "core/signal/band_pass.hpp"

namespace proofmass {
namespace {

constexpr std::size_t block = LineWeights::block_size;

/// Squared steps of the sums of all blocks, over the sessions without excitation.
struct QuietSums {
  double common_squares = 0.0;
  std::array<double, 2> sensor_squares{};
  double num_steps = 0.0;
};

double num_steps(const Scenario& scenario, const Session& session) {
  const auto num_blocks = static_cast<std::size_t>(num_record_samples(scenario, session)) / block;
  return num_blocks < 2 ? 1.0 : static_cast<double>(num_blocks - 1);
}

/// One-sided density at low frequency of a signal whose block sums took these steps: a sum of n
/// samples has the variance n S/(2T), a step twice as much.
double density(double squares, double steps, double period_s) {
  return squares / (2.0 * steps) * 2.0 * period_s / static_cast<double>(block);
}

/// What is not a number counts as too large to be stored.
double bounded(double value) { return value <= magnitude_max ? value : magnitude_max; }

/// Γ_mes,c at f_EP; the band-pass takes r⁴/(1 + r⁴) of a line at its centre.
double residual_amplitude(const Scenario& scenario, const SessionHealth& session) {
  const double ratio = scenario.estimation.band_ratio;
  const double fourth = ratio * ratio * ratio * ratio;
  double largest = 0.0;
  for (const auto& [cosine, sine] : session.monitor.residual) {
    largest = std::max(largest, std::sqrt(cosine * cosine + sine * sine));
  }
  return bounded(largest * (1.0 + fourth) / fourth);
}

double square_density(const Scenario& scenario, double squares, const QuietSums& quiet) {
  return density(squares, quiet.num_steps, scenario.simulation.sample_period_s);
}

/// Power of the noise at the session's lines over that of the squared signal there: cosine and sine
/// of a line each have the variance S/duration.
double square_noise_of(const Scenario& scenario, const Session& session,
                       const SessionPhasors& phasors, const QuietSums& quiet) {
  double squares = 0.0;
  switch (target_info(session.target).product) {
    case Product::common_squared:
      squares = quiet.common_squares;
      break;
    case Product::sensor_1_squared:
      squares = quiet.sensor_squares[0];
      break;
    case Product::sensor_2_squared:
      squares = quiet.sensor_squares[1];
      break;
    default:
      return 0.0;
  }
  double signal = 0.0;
  for (std::size_t i = 0; i < phasors.num_fit_lines; ++i) {
    signal += std::norm(phasors.amplitude[index(Signal::product)][i]);
  }
  return 2.0 * square_density(scenario, squares, quiet) / fit_duration_s(scenario, session) *
         static_cast<double>(phasors.num_fit_lines) / signal;
}

/// The same where one fit reads the squares of both sensors at lines of all sessions: each counts
/// by its power.
double square_noise_of_all(const Scenario& scenario, const RunPhasors& phasors,
                           const QuietSums& quiet) {
  const EstimationMethodInfo& method = estimation_method(scenario.estimation.method);
  std::array<double, 2> signal{};
  for (std::size_t i = 0; i < phasors.size(); ++i) {
    const Session& session = scenario.sessions[i];
    const std::vector<WantedLine> lines = method.needs(session).lines;
    for (std::size_t k = 0; k < lines.size(); ++k) {
      if (lines[k].signals != LineSignals::squares) continue;
      for (std::size_t sensor = 0; sensor < signal.size(); ++sensor) {
        signal[sensor] += fit_duration_s(scenario, session) *
                          std::norm(phasors[i].lines[k][num_line_bases + sensor]);
      }
    }
  }
  double largest = 0.0;
  for (std::size_t sensor = 0; sensor < signal.size(); ++sensor) {
    const double noise = square_density(scenario, quiet.sensor_squares[sensor], quiet);
    if (signal[sensor] == 0.0) continue;  // No session has such a line.
    largest = std::max(largest, bounded(2.0 * noise / signal[sensor]));
  }
  return largest;
}

/// LoopHealth::square_noise of a run; 0 if no session watches the noise.
double square_noise(const Scenario& scenario, const RunPhasors& phasors, const QuietSums& quiet) {
  if (quiet.num_steps == 0.0) return 0.0;
  const bool has_further_lines = std::ranges::any_of(
      phasors, [](const SessionPhasors& of_session) { return !of_session.lines.empty(); });
  if (has_further_lines) return square_noise_of_all(scenario, phasors, quiet);
  double largest = 0.0;
  for (std::size_t i = 0; i < phasors.size(); ++i) {
    largest = std::max(largest,
                       bounded(square_noise_of(scenario, scenario.sessions[i], phasors[i], quiet)));
  }
  return largest;
}

/// Health of one session.
LoopHealth session_health(const Scenario& scenario, const Session& session,
                          const SessionHealth& record, const SessionPhasors& phasors) {
  LoopHealth health{.acceleration_m_s2 = bounded(record.acceleration_m_s2),
                    .attitude_rad = bounded(record.attitude_rad)};
  // Loops that grew beyond all numbers left none to look at.
  const double left = is_test(session) ? phasors.test_products[index(TestSignal::differential_x)]
                                       : phasors.amplitude[index(Signal::differential_x)][0].real();
  if (!std::isfinite(left)) health.acceleration_m_s2 = magnitude_max;
  if (!record.is_monitored) return health;
  health.residual_m_s2 = residual_amplitude(scenario, record);
  health.quadratic_noise =
      bounded(density(record.monitor.quadratic.squares, num_steps(scenario, session),
                      scenario.simulation.sample_period_s) /
              least_noise_density(scenario));
  return health;
}

LossCause cause_of(Effect effect) {
  switch (effect) {
    case Effect::residual:
      return LossCause::residual;
    case Effect::quadratic_noise:
      return LossCause::quadratic_noise;
    case Effect::square_noise:
      return LossCause::square_noise;
    case Effect::attitude:
    case Effect::spin:
      break;
  }
  return LossCause::attitude;
}

/// Why the estimates of loops that held are lost all the same.
LoopLoss loss_by_shift(const ShiftBounds& bounds, const LoopHealth& health,
                       const ParameterArray& truth, std::span<const double> standard_errors) {
  for (const Shift& shift : bounds.of(health, truth, standard_errors)) {
    if (shift.part <= shift.part_of_loss) continue;
    return {.cause = cause_of(shift.effect), .session = finding_session(shift.parameter)};
  }
  return {};
}

void take_larger(LoopHealth& largest, const LoopHealth& health) {
  for (const HealthValue& value : health_values()) {
    largest.*value.member = std::max(largest.*value.member, health.*value.member);
  }
}

}  // namespace

LineFit residual_fit(const Scenario& scenario, const Session& session) {
  const double period_s = scenario.orbit.period_s;
  const double resolution_hz = 1.0 / (session.num_orbits * period_s);
  const double ratio = scenario.estimation.band_ratio;
  LineFit fit = line_fit(scenario, session);
  fit.known_hz.clear();
  double frequency_hz = test_frequency_hz(session, period_s);
  if (frequency_hz < 0.99 * resolution_hz) frequency_hz = 1.0 / period_s;
  fit.fit_hz = {frequency_hz};
  for (const auto* const lines : {&session.fit_lines, &session.known_lines}) {
    for (const LineMultiple& line : *lines) {
      const double other_hz = line_frequency_hz(session, line, period_s);
      if (std::abs(other_hz - frequency_hz) < 0.99 * resolution_hz) continue;
      if (fit.known_hz.size() + 1 < num_session_lines_max) fit.known_hz.push_back(other_hz);
    }
  }
  fit.filter = band_pass(frequency_hz / ratio, frequency_hz * ratio, fit.sample_period_s);
  return fit;
}

HealthFinding judge_health(const Scenario& scenario, const ShiftBounds& bounds,
                           const HealthRecord& record, const RunPhasors& phasors,
                           const ParameterArray& truth, std::span<const double> standard_errors) {
  PROOFMASS_EXPECT(record.size() == scenario.sessions.size() && phasors.size() == record.size());
  QuietSums quiet;
  for (std::size_t i = 0; i < record.size(); ++i) {
    const SessionHealth& of_session = record[i];
    if (!of_session.is_monitored) continue;
    quiet.common_squares += of_session.monitor.common_square.squares;
    quiet.sensor_squares[0] += of_session.monitor.sensor_square[0].squares;
    quiet.sensor_squares[1] += of_session.monitor.sensor_square[1].squares;
    quiet.num_steps += num_steps(scenario, scenario.sessions[i]);
  }
  HealthFinding finding;
  bool has_test_largest_attitude = false;
  for (std::size_t i = 0; i < record.size(); ++i) {
    const Session& session = scenario.sessions[i];
    const LoopHealth health = session_health(scenario, session, record[i], phasors[i]);
    if (health.attitude_rad > finding.health.attitude_rad) {
      has_test_largest_attitude = is_test(session);
    }
    take_larger(finding.health, health);
    if (is_test(session)) {
      finding.test_residual_m_s2 =
          std::max(finding.test_residual_m_s2, bounded(test_residual_m_s2(phasors[i])));
    }
    const bool is_saturated = health.acceleration_m_s2 > scenario.sensor.range_m_s2;
    if (finding.loss.cause != LossCause::none || !is_saturated) continue;
    finding.loss = {.cause = LossCause::saturation, .session = session.target};
  }
  finding.health.square_noise = square_noise(scenario, phasors, quiet);
  if (finding.loss.cause == LossCause::none) {
    finding.loss = loss_by_shift(bounds, finding.health, truth, standard_errors);
  }
  if (finding.loss.cause == LossCause::attitude && has_test_largest_attitude) {
    finding.loss.session = SessionTarget::ep_test;
  }
  return finding;
}

}  // namespace proofmass
