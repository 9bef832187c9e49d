#include "core/microscope/simulation/run_parts.hpp"

#include <algorithm>

#include "core/error.hpp"
#include "core/microscope/campaign/loop_margins.hpp"
#include "core/microscope/instrument/stiffness.hpp"
#include "core/microscope/session/gaps.hpp"
#include "core/microscope/simulation/line_fit.hpp"

namespace proofmass {
namespace {

/// Signals that are not recorded stay 0: where lanes are in different sessions they are summed,
/// too.
void keep_fit_lines(const SignalSums<double>& sums, SignalSet recorded, SessionPhasors& phasors) {
  const std::size_t num_recorded = recorded == SignalSet::all ? num_signals : num_common_signals;
  for (std::size_t s = 0; s < num_recorded; ++s) {
    const bool is_of_health = s == index(Signal::differential_x) || s == index(Signal::product);
    if (recorded == SignalSet::health && !is_of_health) continue;
    for (std::size_t i = 0; i < phasors.num_fit_lines; ++i) {
      phasors.amplitude[s][i] = {sums[s][2 * i], sums[s][2 * i + 1]};
    }
  }
}

/// Keeps what was recorded beside the session's own lines.
void keep_further(const FurtherSums<double>& sums, const std::vector<LineGroup>& groups,
                  std::size_t num_samples, SessionPhasors& phasors) {
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const std::vector<std::size_t>& lines = groups[g].lines;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (phasors.lines.size() <= lines[i]) phasors.lines.resize(lines[i] + 1);
      for (std::size_t s = 0; s < num_line_signals; ++s) {
        phasors.lines[lines[i]][s] = {sums.lines[g][s][2 * i], sums.lines[g][s][2 * i + 1]};
      }
    }
  }
  for (std::size_t s = 0; s < num_line_bases; ++s) {
    phasors.means[s] = sums.plain[s] / static_cast<double>(num_samples);
  }
}

}  // namespace

RunParts::RunParts(const MicroscopeCampaign& c, const EstimationMethodInfo& m)
    : campaign(c),
      method(m),
      laws(drawn_moments(c.dispersions)),
      orbit(c.scenario.orbit),
      environment(campaign.scenario.environment, campaign.environment_table,
                  c.scenario.orbit.period_s),
      noise(make_noise_model(c.scenario.noise, c.scenario.simulation.sample_period_s)),
      drag_free(drag_free_gains(c.scenario.drag_free, c.scenario.simulation.sample_period_s)),
      attitude(attitude_gains(c.scenario.attitude, c.scenario.simulation.sample_period_s)),
      bounds(c.scenario, c.dispersions),
      recording(recording_of(c.scenario, noise)),
      weights_of_windows(mean_linear_x(c.scenario.noise), c.scenario.simulation.sample_period_s) {
  weights.reserve(campaign.scenario.sessions.size());
  residual_weights.resize(campaign.scenario.sessions.size());
  for (std::size_t i = 0; i < campaign.scenario.sessions.size(); ++i) {
    const Session& session = campaign.scenario.sessions[i];
    weights.emplace_back(line_fit(campaign.scenario, session));
    tests.push_back({.semi_latus_rectum_m = orbit.semi_latus_rectum_m(),
                     .eccentricity = orbit.eccentricity(),
                     .num_blocks = weights.back().num_samples() / test_block_size});
    const RecordNeeds& asked = needs.emplace_back(method.needs(session));
    groups.push_back(line_groups(campaign.scenario, session, asked));
    PROOFMASS_EXPECT(groups.back().size() <= num_line_readers_max);
    auto& of_groups = group_weights.emplace_back();
    for (const LineGroup& group : groups.back()) of_groups.emplace_back(group.fit);
    if (is_test(session) || !session.excitations.empty() || is_monitored_before(i)) continue;
    residual_weights[i].emplace(residual_fit(campaign.scenario, session));
  }
  for (std::size_t i = 0; i < tests.size(); ++i) regressors.push_back(nominal_regressors(i));
  if (campaign.scenario.gaps.lose_data()) return;
  // The windows of every run are those of the first.
  for (std::size_t i = 0; i < tests.size(); ++i) {
    const std::vector<WindowRegressors> of_windows = std::move(regressors[i]);
    const auto& of_complete =
        weights_of_complete.emplace_back(weights_of_windows.of(lost(i, RunIndex{0})));
    noise_of_complete.push_back(weights_of_windows.noise_products(of_complete, of_windows));
  }
}

std::vector<bool> RunParts::lost(std::size_t i, RunIndex run) const {
  const Scenario& scenario = campaign.scenario;
  if (!is_test(scenario.sessions[i])) return {};
  return lost_blocks(scenario.gaps, scenario.sessions[i], campaign.seed, run, tests[i].num_blocks,
                     scenario.orbit.period_s, scenario.simulation.sample_period_s);
}

std::span<const float> RunParts::window_weights(std::size_t i, RunIndex run,
                                                std::vector<float>& room) const {
  if (!weights_of_complete.empty()) return weights_of_complete[i];
  room = weights_of_windows.of(lost(i, run));
  return room;
}

RegressorProducts RunParts::window_noise(std::size_t i, RunIndex run) const {
  if (!noise_of_complete.empty()) return noise_of_complete[i];
  std::vector<float> room;
  return weights_of_windows.noise_products(window_weights(i, run, room), regressors[i]);
}

std::vector<WindowRegressors> RunParts::nominal_regressors(std::size_t i) const {
  const Session& session = campaign.scenario.sessions[i];
  std::vector<WindowRegressors> of_windows;
  if (!is_test(session)) return of_windows;
  Scenario of_blocks = campaign.scenario;  // A sample at the beginning of each block.
  of_blocks.simulation.sample_period_s *= static_cast<double>(test_block_size);
  of_blocks.simulation.settling_s = 0.0;
  SessionSignals signals(of_blocks, session, orbit, environment);
  for (std::size_t block = 0; block < tests[i].num_blocks; ++block) {
    const SharedSample sample = signals.next();
    if (block == 0) continue;  // A window's middle is between two blocks.
    const Vector3<double>& radial_S = sample.radial_R;
    const double gradient = 3.0 * sample.gradient_s2 * radial_S.x;
    of_windows.push_back({-tests[i].gravity_m_s2(sample) * radial_S.x, gradient * radial_S.x,
                          gradient * radial_S.z});
  }
  return of_windows;
}

bool RunParts::has_stiffness() const {
  return std::ranges::any_of(campaign.scenario.sessions, [&](const Session& session) {
    return feels_stiffness(campaign.scenario.sensor, session);
  });
}

bool RunParts::is_monitored_before(std::size_t i) const {
  const Session& session = campaign.scenario.sessions[i];
  for (std::size_t k = 0; k < i; ++k) {
    const Session& before = campaign.scenario.sessions[k];
    if (is_monitored(k) && before.spin_rate_rad_s == session.spin_rate_rad_s &&
        before.drag_free == session.drag_free) {
      return true;
    }
  }
  return false;
}

SessionSetup RunParts::setup(std::size_t i, Readers& readers) const {
  const Session& session = campaign.scenario.sessions[i];
  TestMasses masses =
      mass_excitation(session) == nullptr ? TestMasses::at_rest : TestMasses::moving;
  if (feels_stiffness(campaign.scenario.sensor, session)) masses = TestMasses::moving_twice;
  return {.masses = masses,
          .reader = &readers.lines,
          .drag_free = drag_free,
          .attitude = attitude,
          .product = target_info(session.target).product,
          .signals = needs[i].signals,
          .line_readers = readers.further,
          .residual_reader = readers.residual ? &*readers.residual : nullptr,
          .test = is_test(session) ? &tests[i] : nullptr,
          .resonator = resonator_in(campaign.scenario, session)};
}

RunRecord RunParts::drawn_record(RunIndex run, const AcceptedDraw& draw) const {
  const Scenario& scenario = campaign.scenario;
  RunRecord record{
      .run = run, .num_draws = draw.num_draws, .has_draw = draw.instrument.has_value()};
  record.phasors.resize(scenario.sessions.size());
  record.health.resize(scenario.sessions.size());
  if (draw.instrument) {
    record.truth = true_parameters(*draw.instrument, common_offset_x(scenario, *draw.instrument));
    record.eotvos_parameter = draw.instrument->eotvos_parameter;
    if (!scenario.has_plain_loops()) {
      const Margins margins = least(loop_margins(scenario, *draw.instrument));
      record.margins = {std::min(margins.gain, magnitude_max), margins.phase_rad};
    }
  }
  return record;
}

void RunParts::keep(std::size_t i, const SessionOutcome& outcome, RunRecord& record) const {
  SessionPhasors& phasors = record.phasors[i];
  phasors.num_fit_lines = weights[i].num_fit_lines();
  keep_fit_lines(outcome.sums, needs[i].signals, phasors);
  if (!groups[i].empty()) {
    keep_further(outcome.further, groups[i], weights[i].num_samples(), phasors);
  }
  if (is_test(campaign.scenario.sessions[i])) {
    phasors.test_products.assign(outcome.test_products.begin(), outcome.test_products.end());
    phasors.square_steps = outcome.square_steps;
    phasors.test_noise = window_noise(i, record.run);
  }
  record.health[i] = outcome.health;
  record.health[i].is_monitored = is_monitored(i);
}

}  // namespace proofmass
