// What follows from the equations of a session alone: its signal, and how far effects move
// estimates.

#include "core/microscope/campaign/shift_bounds.hpp"

#include "core/error.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/campaign/regressor_lines.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/support/runs.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

/// A nominal instrument without noise, in sessions of two orbits.
MicroscopeCampaign silent_campaign() {
  MicroscopeCampaign campaign;
  campaign.scenario.noise.scale = 0.0;
  campaign.dispersions = test::perfect_laws();
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 2;
  return campaign;
}

/// The paper's session of that number, turning with the rate 4.5 n.
void spin(MicroscopeCampaign& campaign, std::size_t i) {
  Session& session = campaign.scenario.sessions[i];
  session.spin_rate_rad_s = 4.5 * 2.0 * std::numbers::pi / campaign.scenario.orbit.period_s;
  session.fit_lines = {{2, 0, 2}};
  session.known_lines = {};
}

/// Amplitudes at the fit lines against those of the simulation, behind the band-pass. The
/// simulation adds what the environment and the filter's transient leave.
void expect_signals_of_simulation(const MicroscopeCampaign& campaign) {
  const Scenario& scenario = campaign.scenario;
  const RunRecord record = RunPlan(campaign).record(RunIndex{0}, {});
  for (std::size_t i = 0; i < scenario.sessions.size(); ++i) {
    const Session& session = scenario.sessions[i];
    const std::vector<double> amplitudes =
        fitted_amplitudes(scenario, session, regressor_lines(scenario, session));
    for (std::size_t k = 0; k < amplitudes.size(); ++k) {
      const double frequency_hz =
          line_frequency_hz(session, session.fit_lines[k], scenario.orbit.period_s);
      const double expected =
          amplitudes[k] * std::sqrt(band_gain_squared(scenario, session, frequency_hz));
      const auto& simulated =
          record.phasors[i].amplitude[index(target_info(session.target).regressor)];
      EXPECT_NEAR(std::abs(simulated[k]) / expected, 1.0, 0.03) << session.name << ", line " << k;
    }
  }
}

TEST(RegressorLines, AreThoseOfTheSimulation) { expect_signals_of_simulation(silent_campaign()); }

TEST(RegressorLines, AreThoseOfTheSimulationInAFrameThatSpins) {
  MicroscopeCampaign campaign = silent_campaign();
  campaign.scenario.orbit.eccentricity = 0.05;
  spin(campaign, 0);
  spin(campaign, 1);
  campaign.scenario.sessions.resize(2);
  expect_signals_of_simulation(campaign);
}

std::string refusal_of(const std::function<void(MicroscopeCampaign&)>& change) {
  MicroscopeCampaign campaign;
  change(campaign);
  return test::message_of<ConfigError>([&] {
    campaign.validate();
    check_regressors(campaign.scenario);
  });
}

TEST(RegressorLines, MustBeThereWhereTheyAreFitted) {
  const std::string turned = refusal_of([](MicroscopeCampaign& campaign) {
    campaign.scenario.sessions[0].spin_rate_rad_s = 4.75e-3;
  });
  EXPECT_NE(turned.find("session[0].fit_lines[0] = [2, 0] (session a_c11_delta_x has no signal of "
                        "a_c11_delta_x there, at 0.0003361 Hz"),
            std::string::npos)
      << turned;
  EXPECT_NE(turned.find("as [2, 0, 2] does"), std::string::npos) << turned;
  EXPECT_EQ(refusal_of([](MicroscopeCampaign& campaign) { spin(campaign, 0); }), "");
  // All targets but those of the gradient: away from their excitation.
  for (std::size_t i = 2; i < 11; ++i) {
    const std::string moved = refusal_of([&](MicroscopeCampaign& campaign) {
      campaign.scenario.sessions[i].fit_lines = {{0, 0.7}};
      campaign.scenario.sessions[i].known_lines = {};
    });
    EXPECT_NE(moved.find("has no signal of"), std::string::npos) << i << moved;
    // a_c12 and a_c13 have two, f_TM ± 2 f_orb.
    const bool is_modulated = i == 3 || i == 4;
    EXPECT_EQ(moved.find("line is at 0.00954") != std::string::npos ||
                  moved.find("line is at 0.01022") != std::string::npos,
              is_modulated)
        << moved;
  }
}

// The gradient of a geostationary orbit, 200 times as small: the line is the right one.
TEST(RegressorLines, MayBeTooWeak) {
  const std::string weak =
      refusal_of([](MicroscopeCampaign& campaign) { campaign.scenario.orbit.period_s = 86164.0; });
  EXPECT_NE(weak.find("session a_c12 has too little signal of a_c12 there"), std::string::npos)
      << weak;
  EXPECT_NE(weak.find("make the session longer, or its excitation larger"), std::string::npos);
}

// A sensor with twenty times the noise has its signals where others have them.
TEST(RegressorLines, AreThereInEveryNoise) {
  EXPECT_EQ(refusal_of([](MicroscopeCampaign& campaign) {
              campaign.scenario.noise.linear_x.white_asd *= 20.0;
              campaign.scenario.noise.linear_x.rise_asd *= 20.0;
            }),
            "");
}

/// The largest numbers of a nominal campaign, and every truth at its bound.
constexpr LoopHealth nominal_health{.acceleration_m_s2 = 8e-8,
                                    .attitude_rad = 1e-4,
                                    .residual_m_s2 = 1.3e-12,
                                    .quadratic_noise = 2e-3,
                                    .square_noise = 2e-7};
constexpr ParameterArray largest_truth{20e-6, 20e-6,  20e-6,  2.6e-3,  2.6e-3,
                                       1e-2,  1.6e-3, 1.6e-3, 14000.0, 14000.0};

double part_of(const Scenario& scenario, const LoopHealth& health, Effect effect,
               Parameter parameter) {
  for (const Shift& shift :
       ShiftBounds(scenario, nominal_dispersions()).of(health, largest_truth, {})) {
    if (shift.effect == effect && shift.parameter == parameter) return shift.part;
  }
  return 0.0;
}

TEST(ShiftBounds, GiveNoWarningInANominalCampaign) {
  for (const Shift& shift :
       ShiftBounds({}, nominal_dispersions()).of(nominal_health, largest_truth, {})) {
    EXPECT_LT(shift.part, warned_part) << name_of(shift.effect) << index(shift.parameter);
  }
}

// The equations of the table in README.md, with the numbers of the flight's spin.
TEST(ShiftBounds, AreThoseOfTheTable) {
  Scenario scenario;
  LoopHealth health = nominal_health;
  health.residual_m_s2 = 1e-9;
  const double n = 2.0 * std::numbers::pi / scenario.orbit.period_s;
  // 2 K2d R² over ½·1.5 n², in objectives of 100 nm.
  EXPECT_NEAR(part_of(scenario, health, Effect::residual, Parameter::a_c11_delta_x),
              2.0 * 14000.0 * 1e-18 / (0.75 * n * n) / 1e-7, 0.01);
  health = nominal_health;
  health.attitude_rad = 0.01;
  EXPECT_NEAR(part_of(scenario, health, Effect::attitude, Parameter::a_c12), 1e-4 / 9e-4, 1e-9);
  health = nominal_health;
  health.square_noise = 2.0 * 0.01 / 9.0;  // Three standard deviations of 1 + x are 0.1.
  EXPECT_NEAR(part_of(scenario, health, Effect::square_noise, Parameter::k2c),
              14000.0 * (0.1 / 0.9) / 1000.0, 1e-9);
  health.square_noise = 1.0;
  EXPECT_TRUE(std::isinf(part_of(scenario, health, Effect::square_noise, Parameter::k2d)));
  for (Session& session : scenario.sessions) session.spin_rate_rad_s = 17.5 * n;
  EXPECT_NEAR(part_of(scenario, nominal_health, Effect::spin, Parameter::a_d11_prime),
              14000.0 * 20e-6 * (17.5 * 17.5 + 0.5) * n * n / 1.5e-4, 1e-6);
}

// The bounds by standard errors: noise of the density of the sensors' floor makes errors of σ at
// most, of which three are given, and a line moves an estimate by no more than σ for each standard
// deviation that the line moves.
TEST(ShiftBounds, FollowTheStandardErrorsOfAMethodThatHasThem) {
  const Scenario scenario;
  const ShiftBounds bounds(scenario, nominal_dispersions());
  const ParameterArray sigmas{4e-9, 4e-9, 6e-8, 4e-4, 4e-4, 3e-7, 2e-7, 2e-7, 8.0, 9.0};
  ParameterArray truth = largest_truth;
  const auto part = [&](const LoopHealth& health, Effect effect, Parameter parameter) {
    for (const Shift& shift : bounds.of(health, truth, sigmas)) {
      if (shift.effect == effect && shift.parameter == parameter) return shift.part;
    }
    return 0.0;
  };
  for (const Shift& shift : bounds.of(nominal_health, largest_truth, sigmas)) {
    EXPECT_LT(shift.part, warned_part) << name_of(shift.effect) << index(shift.parameter);
    EXPECT_NE(shift.effect, Effect::spin);
  }
  const double floor = 0.5 * 1.4e-12 * 1.4e-12;
  LoopHealth health{.quadratic_noise = 4.0 * floor / least_noise_density(scenario)};
  // The line of the gradient that is known beforehand takes off some 1e-5, without offcentrings.
  truth[index(Parameter::a_c11_delta_x)] = truth[index(Parameter::a_c11_delta_z)] = 0.0;
  EXPECT_NEAR(part(health, Effect::quadratic_noise, Parameter::a_c12), 3.0 * 2.0 * 4e-4 / 9e-4,
              1e-4);
  truth = largest_truth;
  health = {.residual_m_s2 = 1e-9};
  // 140 orbits less the transients, two lines each, moved by ½ K2d (2e-9)².
  const double duration_s =
      140.0 * scenario.orbit.period_s -
      static_cast<double>(scenario.sessions.size()) * scenario.estimation.transient_s;
  EXPECT_NEAR(part(health, Effect::residual, Parameter::a_c11_delta_x),
              4e-9 * std::sqrt(2.0 * duration_s / floor) * 0.5 * 14000.0 * 4e-18 / 1e-7, 1e-6);
}

// What b_1d makes of the gradient's line looks like noise to blocks of 512 s, whatever its law.
TEST(ShiftBounds, TakeTheLineOfAConstantForNoNoise) {
  const Scenario scenario;
  constexpr double bias_m_s2 = 5e-8;  // b_1d, with p of both masses at opposite bounds.
  DispersionSet laws = nominal_dispersions();
  const std::size_t first = draw_group("parasitic_acceleration_m_s2").first;
  laws[first] = {.law = Law::fixed, .value = -bias_m_s2};
  laws[first + 3] = {.law = Law::fixed, .value = bias_m_s2};
  ParameterArray truth{};
  truth[index(Parameter::k2d)] = 14000.0;
  truth[index(Parameter::a_c11_delta_z)] = 20e-6;

  const double n = 2.0 * std::numbers::pi / scenario.orbit.period_s;
  const double x = 512.0 * n;  // Half the line's turn in a block, at 2 f_orb.
  const double line_m_s2 = 2.0 * bias_m_s2 * 14000.0 * 0.75 * n * n * 20e-6;
  const double steps = line_m_s2 * std::sin(x) * std::sin(x) / x;
  const double density = 2.0 * 512.0 * steps * steps;
  const auto largest = [&](double part, const DispersionSet& of) {
    const LoopHealth health{.quadratic_noise = part * density / least_noise_density(scenario)};
    double shift = 0.0;
    for (const Shift& each : ShiftBounds(scenario, of).of(health, truth, {})) {
      if (each.effect == Effect::quadratic_noise) shift = std::max(shift, each.part);
    }
    return shift;
  };
  EXPECT_EQ(largest(0.999, laws), 0.0);
  EXPECT_GT(largest(1.001, laws), 0.0);
  EXPECT_GT(largest(0.999, nominal_dispersions()), 0.0);
}

// Noise that the user asks for is no reason to lose a run: errors show it.
TEST(ShiftBounds, LoseNoRunToNoiseThatTheSensorsExplain) {
  Scenario scenario;
  scenario.noise.scale = 10.0;
  LoopHealth health = nominal_health;
  health.square_noise *= 5e3;  // The fourth power, and half as much again as is seen.
  // Of K2 = K2c ± K2d, each within 14000 s²/m.
  for (const Parameter only : {Parameter::k2d, Parameter::k2c}) {
    ParameterArray truth = largest_truth;
    truth[index(Parameter::k2d)] = truth[index(Parameter::k2c)] = 0.0;
    truth[index(only)] = 14000.0;
    for (const Shift& shift : ShiftBounds(scenario, nominal_dispersions()).of(health, truth, {})) {
      EXPECT_LE(shift.part, shift.part_of_loss) << name_of(shift.effect) << index(shift.parameter);
    }
  }
}

}  // namespace
}  // namespace proofmass
