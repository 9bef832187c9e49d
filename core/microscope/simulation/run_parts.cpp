#include "core/microscope/simulation/run_parts.hpp"

#include "core/microscope/simulation/line_fit.hpp"

namespace proofmass {
namespace {

/// Signals that are not recorded stay 0: where lanes are in different sessions they are summed,
/// too.
void append_lines(const SignalSums<double>& sums, SignalSet recorded, std::size_t num_lines,
                  SessionPhasors& phasors) {
  const std::size_t num_recorded = recorded == SignalSet::all ? num_signals : num_common_signals;
  for (std::size_t s = 0; s < num_recorded; ++s) {
    for (std::size_t i = 0; i < num_lines; ++i) {
      phasors.amplitude[s][phasors.num_lines + i] = {sums[s][2 * i], sums[s][2 * i + 1]};
    }
  }
  phasors.num_lines += num_lines;
}

}  // namespace

RunParts::RunParts(const MicroscopeCampaign& c, const EstimationMethodInfo& m)
    : campaign(c),
      method(m),
      orbit(c.scenario.orbit),
      environment(campaign.scenario.environment, campaign.environment_table,
                  c.scenario.orbit.period_s),
      noise(make_noise_model(c.scenario.noise, c.scenario.simulation.sample_period_s)),
      drag_free(drag_free_gains(c.scenario.drag_free, c.scenario.simulation.sample_period_s)),
      attitude(attitude_gains(c.scenario.attitude, c.scenario.simulation.sample_period_s)),
      bounds(c.scenario),
      recording(recording_of(c.scenario, noise)) {
  weights.reserve(campaign.scenario.sessions.size());
  known_weights.resize(campaign.scenario.sessions.size());
  residual_weights.resize(campaign.scenario.sessions.size());
  for (std::size_t i = 0; i < campaign.scenario.sessions.size(); ++i) {
    const Session& session = campaign.scenario.sessions[i];
    const LineFit fit = line_fit(campaign.scenario, session);
    weights.emplace_back(fit);
    if (method.needs(session).lines == RecordedLines::all) {
      for (const LineFit& known : known_line_fits(fit)) known_weights[i].emplace_back(known);
    }
    if (!session.excitations.empty() || is_monitored_before(i)) continue;
    residual_weights[i].emplace(residual_fit(campaign.scenario, session));
  }
}

bool RunParts::is_monitored_before(std::size_t i) const {
  const Session& session = campaign.scenario.sessions[i];
  for (std::size_t k = 0; k < i; ++k) {
    const Session& before = campaign.scenario.sessions[k];
    if (is_quiet(k) && before.spin_rate_rad_s == session.spin_rate_rad_s &&
        before.drag_free == session.drag_free) {
      return true;
    }
  }
  return false;
}

SessionSetup RunParts::setup(std::size_t i, Readers& readers) const {
  const Session& session = campaign.scenario.sessions[i];
  return {.masses = mass_excitation(session) == nullptr ? TestMasses::at_rest : TestMasses::moving,
          .reader = &readers.lines,
          .drag_free = drag_free,
          .attitude = attitude,
          .product = target_info(session.target).product,
          .signals = method.needs(session).signals,
          .known_readers = readers.known,
          .residual_reader = readers.residual ? &*readers.residual : nullptr};
}

RunRecord RunParts::drawn_record(RunIndex run, const AcceptedDraw& draw) const {
  const Scenario& scenario = campaign.scenario;
  RunRecord record{
      .run = run, .num_draws = draw.num_draws, .has_draw = draw.instrument.has_value()};
  record.phasors.resize(scenario.sessions.size());
  record.health.resize(scenario.sessions.size());
  if (draw.instrument) {
    record.truth =
        true_parameters(*draw.instrument, scenario.drag_free.bias_compensation_error_x_m_s2);
  }
  return record;
}

void RunParts::keep(std::size_t i, const SessionOutcome& outcome, RunRecord& record) const {
  SessionPhasors& phasors = record.phasors[i];
  const SignalSet recorded = method.needs(campaign.scenario.sessions[i]).signals;
  append_lines(outcome.sums, recorded, weights[i].num_fit_lines(), phasors);
  phasors.num_fit_lines = phasors.num_lines;
  for (std::size_t k = 0; k < known_weights[i].size(); ++k) {
    append_lines(outcome.known_sums[k], recorded, known_weights[i][k].num_fit_lines(), phasors);
  }
  record.health[i] = outcome.health;
  record.health[i].is_quiet = is_quiet(i);
}

}  // namespace proofmass
