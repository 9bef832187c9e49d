#include "core/simulation/run.hpp"

#include <cmath>
#include <vector>

#include "core/campaign/draw.hpp"
#include "core/estimation/calibration.hpp"
#include "core/simulation/session_record.hpp"

namespace proofmass {
namespace {

LineFit line_fit(const Scenario& scenario, const Session& session) {
  const double period_s = scenario.simulation.sample_period_s;
  LineFit fit;
  fit.num_samples = static_cast<std::size_t>(num_record_samples(scenario, session));
  fit.num_dropped = static_cast<std::size_t>(std::ceil(scenario.estimation.transient_s / period_s));
  fit.sample_period_s = period_s;
  double centre_hz = 0.0;
  for (const LineMultiple& line : session.fit_lines) {
    fit.fit_hz.push_back(line_frequency_hz(session, line, scenario.orbit.period_s));
    centre_hz += fit.fit_hz.back() / static_cast<double>(session.fit_lines.size());
  }
  for (const LineMultiple& line : session.known_lines) {
    fit.known_hz.push_back(line_frequency_hz(session, line, scenario.orbit.period_s));
  }
  const double ratio = scenario.estimation.band_ratio;
  fit.filter = band_pass(centre_hz / ratio, centre_hz * ratio, period_s);
  return fit;
}

SessionPhasors to_phasors(const SignalSums<double>& sums, std::size_t num_lines) {
  SessionPhasors phasors;
  phasors.num_lines = num_lines;
  for (std::size_t s = 0; s < num_signals; ++s) {
    for (std::size_t i = 0; i < num_lines; ++i) {
      phasors.amplitude[s][i] = {sums[s][2 * i], sums[s][2 * i + 1]};
    }
  }
  return phasors;
}

bool all_finite(const ParameterArray& values) {
  for (const double value : values) {
    if (!std::isfinite(value)) return false;
  }
  return true;
}

}  // namespace

struct RunPlan::Parts {
  explicit Parts(const Campaign& c)
      : campaign(c),
        orbit(c.scenario.orbit),
        environment(campaign.scenario.environment, campaign.environment_table,
                    c.scenario.orbit.period_s),
        noise(make_noise_model(c.scenario.noise, c.scenario.simulation.sample_period_s)),
        drag_free(drag_free_gains(c.scenario.drag_free, c.scenario.simulation.sample_period_s)),
        attitude(attitude_gains(c.scenario.attitude, c.scenario.simulation.sample_period_s)) {
    for (const Session& session : campaign.scenario.sessions) {
      weights.emplace_back(line_fit(campaign.scenario, session));
    }
  }

  template <typename Progress>
  SessionPhasors simulate_session(std::size_t i, const Instrument& instrument, RunIndex run,
                                  const Progress& progress) const {
    const Scenario& scenario = campaign.scenario;
    const Session& session = scenario.sessions[i];
    SessionNoise session_noise(noise, campaign.seed, run, session.name);
    const SignalSums<double> sums =
        record_session<double>(SessionSignals(scenario, session, orbit, environment), weights[i],
                               make_loop_constants(instrument, scenario, session), drag_free,
                               attitude, regressor_kind(session.target), session_noise, progress);
    return to_phasors(sums, weights[i].num_fit_lines());
  }

  Campaign campaign;
  KeplerOrbit orbit;
  Environment environment;
  NoiseModel noise;
  DragFreeGains drag_free;
  AttitudeGains attitude;
  std::vector<LineWeights> weights;  ///< Of each session.
};

RunPlan::RunPlan(const Campaign& campaign) : parts_(std::make_unique<Parts>(campaign)) {}
RunPlan::~RunPlan() = default;
RunPlan::RunPlan(RunPlan&&) noexcept = default;
RunPlan& RunPlan::operator=(RunPlan&&) noexcept = default;

int RunPlan::num_orbits() const {
  int total = 0;
  for (const Session& session : parts_->campaign.scenario.sessions) total += session.num_orbits;
  return total;
}

RunRecord RunPlan::record(RunIndex run, std::span<const double> table_values,
                          const std::function<void(int)>& progress) const {
  const Campaign& campaign = parts_->campaign;
  const Scenario& scenario = campaign.scenario;
  const AcceptedDraw draw = draw_instrument(campaign, run, table_values);
  RunRecord recorded{
      .run = run, .num_draws = draw.num_draws, .has_draw = draw.instrument.has_value()};
  if (!draw.instrument) return recorded;
  recorded.truth =
      true_parameters(*draw.instrument, scenario.drag_free.bias_compensation_error_x_m_s2);

  int orbits_before = 0;
  const double samples_per_orbit = scenario.orbit.period_s / scenario.simulation.sample_period_s;
  for (std::size_t i = 0; i < scenario.sessions.size(); ++i) {
    const auto report = [&](std::size_t num_samples) {
      const int orbits = static_cast<int>(static_cast<double>(num_samples) / samples_per_orbit);
      if (progress) progress(orbits_before + orbits);
    };
    recorded.phasors[index(scenario.sessions[i].target)] =
        parts_->simulate_session(i, *draw.instrument, run, report);
    orbits_before += scenario.sessions[i].num_orbits;
  }
  return recorded;
}

RunResult RunPlan::estimate(const RunRecord& record) const {
  const Scenario& scenario = parts_->campaign.scenario;
  RunResult result{.run = record.run, .num_draws = record.num_draws, .truth = record.truth};
  if (!record.has_draw) {
    result.status = RunStatus::no_draw;
    return result;
  }
  const CalibrationResult calibration =
      calibrate_hardy2013(record.phasors, scenario.estimation, scenario.objectives);
  result.num_rounds = calibration.num_rounds;
  if (!all_finite(calibration.estimate)) {
    result.status = RunStatus::not_finite;
    return result;
  }
  result.status = calibration.converged ? RunStatus::completed : RunStatus::not_converged;
  result.estimate = calibration.estimate;
  return result;
}

}  // namespace proofmass
