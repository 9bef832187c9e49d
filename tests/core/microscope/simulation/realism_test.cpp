#include "core/microscope/simulation/realism.hpp"

#include <cmath>
#include <numbers>

#include "core/error.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

Scenario scenario_with(const RealismConfig& config) {
  Scenario scenario;
  scenario.realism = config;
  return scenario;
}

LoopConstants<double> constants_of(const Scenario& scenario, const Instrument& instrument) {
  return make_loop_constants(instrument, scenario, scenario.sessions[0]);
}

/// In the first session, from the first sample of its record on.
Realism realism_of(const RealismConfig& config, const Instrument& instrument = make_instrument({}),
                   std::size_t session = 0) {
  const Scenario scenario = scenario_with(config);
  return {scenario, instrument, constants_of(scenario, instrument), session, 0};
}

RealismConfig with_inertia() {
  RealismConfig config;
  config.inertia_kg_m2 = {90.0, 111.0, 75.0};
  return config;
}

// Two short sessions with noise: all that is estimated from them is in their phasors.
TEST(Realism, LeavesEveryBitWhereAllTermsAreOff) {
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.scenario.sessions.resize(2);
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 1;
  const RunRecord without = RunPlan(campaign).record(RunIndex{3}, {});
  campaign.scenario.realism.emplace();
  const RunRecord with = RunPlan(campaign).record(RunIndex{3}, {});
  for (std::size_t i = 0; i < without.phasors.size(); ++i) {
    EXPECT_EQ(with.phasors[i].amplitude, without.phasors[i].amplitude);
  }
  campaign.scenario.realism->star_tracker_latency_samples = 1;
  const RunRecord late = RunPlan(campaign).record(RunIndex{3}, {});
  EXPECT_NE(late.phasors[0].amplitude, without.phasors[0].amplitude);
}

// A sample's instruction set makes no difference: such runs have one loop.
TEST(Realism, HasTheSameBitsInABatch) {
  MicroscopeCampaign campaign = hardy2013_campaign();
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 1;
  campaign.scenario.realism = with_inertia();
  const RunPlan plan(campaign);
  const std::array<RunRequest, 2> requests{{{RunIndex{4}, {}}, {RunIndex{9}, {}}}};
  const std::vector<RunResult> batch =
      plan.simulate_batch(requests, best_instruction_set(), nullptr);
  for (std::size_t i = 0; i < requests.size(); ++i) {
    EXPECT_EQ(batch[i].estimate, plan.simulate(requests[i].run, {}).estimate);
  }
}

TEST(Realism, ReportsOldAngles) {
  RealismConfig config;
  config.star_tracker_latency_samples = 3;
  Realism realism = realism_of(config);
  for (int k = 0; k < 10; ++k) {
    const double now = 1e-5 * (k + 1);
    EXPECT_EQ(realism.seen({now, 0.0, 0.0}).x, k < 3 ? 0.0 : 1e-5 * (k - 2)) << k;
  }
}

// The settling before a record is counted backwards.
TEST(Realism, MovesTheStarTrackerWithTheOrbit) {
  RealismConfig config;
  config.star_tracker_orbital_error_rad = 2e-5;
  config.star_tracker_orbital_phase_rad = 0.4;
  const Instrument instrument = make_instrument({});
  Scenario scenario = scenario_with(config);
  LoopConstants<double> constants = constants_of(scenario, instrument);
  const Vector3<double> bias = constants.star_tracker_bias_S_rad;
  Realism realism(scenario, instrument, constants, 0, 100);
  for (int k = -100; k < 20000; ++k) {
    realism.begin_sample(constants);
    const double t_s = 0.25 * k;
    const double expected = 2e-5 * std::sin(two_pi * t_s / scenario.orbit.period_s + 0.4);
    ASSERT_NEAR(constants.star_tracker_bias_S_rad.z - bias.z, expected, 1e-16) << k;
  }
}

TEST(Realism, LimitsAndRoundsWhatThrustersDeliver) {
  Actuator actuator{.limit = 1e-6, .quantum = 3e-7, .memory = 0.0, .delivered = {}};
  const Vector3<double> delivered = actuator.advance({2e-6, -4.4e-7, 1.4e-7});
  EXPECT_NEAR(delivered.x, 9e-7, 1e-20);  // The limit is 3.33 quanta.
  EXPECT_NEAR(delivered.y, -3e-7, 1e-20);
  EXPECT_EQ(delivered.z, 0.0);
}

// A step of a first-order lag: 1 − e^(−nT/τ).
TEST(Realism, DeliversALagBehindTheCommand) {
  RealismConfig config;
  config.actuation_lag_s = 0.7;
  Realism realism = realism_of(config);
  const LoopConstants<double> constants = constants_of(scenario_with(config), make_instrument({}));
  for (int n = 1; n <= 20; ++n) {
    Vector3<double> thrust_S{1e-7, 0.0, 0.0}, torque_S{0.0, 1e-6, 0.0};
    realism.actuate(constants, zero, thrust_S, torque_S);
    EXPECT_NEAR(thrust_S.x / 1e-7, 1.0 - std::exp(-n * 0.25 / 0.7), 1e-14);
    EXPECT_NEAR(torque_S.y / 1e-6, 1.0 - std::exp(-n * 0.25 / 0.7), 1e-14);
  }
}

// A symmetric top without torque precesses about its axis at Ω_z (J_z − J_x)/J_x. An acceleration
// that is constant over a sample makes Ω_xy grow by ½(λT)² in each: 5e-4 in all.
TEST(Realism, LetsASymmetricTopPrecess) {
  RealismConfig config;
  config.inertia_kg_m2 = {80.0, 80.0, 100.0};
  Realism realism = realism_of(config);
  const LoopConstants<double> constants = constants_of(scenario_with(config), make_instrument({}));
  Loop<double> loop;
  loop.omega_IS_S = {1e-4, 0.0, 4e-3};
  constexpr int num_samples = 16000;
  for (int k = 0; k < num_samples; ++k) {
    Vector3<double> thrust_S{}, torque_S{};
    realism.actuate(constants, loop.omega_IS_S, thrust_S, torque_S);
    loop.rotate(torque_S, 0.25);
  }
  const double angle = 4e-3 * (100.0 - 80.0) / 80.0 * 0.25 * num_samples;
  EXPECT_NEAR(loop.omega_IS_S.x, 1e-4 * std::cos(angle), 1e-7);
  EXPECT_NEAR(loop.omega_IS_S.y, 1e-4 * std::sin(angle), 1e-7);
  EXPECT_NEAR(loop.omega_IS_S.z, 4e-3, 1e-15);
}

// By hand: m Γ_propu = −m Γ_DF is a force of −3e-5 N along X, 5 mm above the centre of mass in Z:
// d × F = (0, −1.5e-7, 0) N m.
TEST(Realism, TurnsThrustIntoTorque) {
  RealismConfig config = with_inertia();
  config.mass_kg = 300.0;
  config.thrust_arm_m = {0.0, 0.0, 5e-3};
  const Scenario scenario = scenario_with(config);
  Instrument instrument = make_instrument({});
  instrument.thrust_matrix = Eigen::Matrix3d::Identity();
  const LoopConstants<double> constants = constants_of(scenario, instrument);
  Realism realism(scenario, instrument, constants, 0, 0);
  Vector3<double> thrust_S{1e-7, 0.0, 0.0}, torque_S{};
  realism.actuate(constants, zero, thrust_S, torque_S);
  EXPECT_NEAR(torque_S.y, -1.5e-7 / 111.0, 1e-22);
  EXPECT_EQ(torque_S.x, 0.0);
  EXPECT_EQ(torque_S.z, 0.0);
}

// [J] times what results is the torque that diag[J] times the command asks for.
TEST(Realism, CommandsTorquesOfThePrincipalMoments) {
  RealismConfig config = with_inertia();
  config.inertia_products_kg_m2 = {2.0, -3.0, 4.0};
  Realism realism = realism_of(config);
  const LoopConstants<double> constants = constants_of(scenario_with(config), make_instrument({}));
  Vector3<double> thrust_S{}, torque_S{1e-6, -2e-6, 3e-6};
  realism.actuate(constants, zero, thrust_S, torque_S);
  EXPECT_NEAR(90.0 * torque_S.x + 2.0 * torque_S.y - 3.0 * torque_S.z, 90e-6, 1e-19);
  EXPECT_NEAR(2.0 * torque_S.x + 111.0 * torque_S.y + 4.0 * torque_S.z, -222e-6, 1e-19);
  EXPECT_NEAR(-3.0 * torque_S.x + 4.0 * torque_S.y + 75.0 * torque_S.z, 225e-6, 1e-19);
}

// Scale 1 + ½(ε_1 + ε_2); the mean misalignment of both sensors turns it: v_K = v_S − θ × v_S.
TEST(Realism, MeasuresRotationInTheFramesOfTheSensors) {
  Instrument instrument = make_instrument({});
  instrument.sensors[0].misalignment_SK_rad = {0.0, 0.0, 2e-3};
  instrument.sensors[1].misalignment_SK_rad = {0.0, 0.0, 4e-3};
  RealismConfig config;
  config.angular_scale_error = {0.03, -0.01};
  EXPECT_NEAR(realism_of(config, instrument).measured({1e-6, 0.0, 0.0}).x, 1.01e-6, 1e-21);
  EXPECT_EQ(realism_of(config, instrument).measured({1e-6, 0.0, 0.0}).y, 0.0);
  config.angular_scale_error = {};
  config.angular_alignment = 0.5;
  EXPECT_NEAR(realism_of(config, instrument).measured({1e-6, 0.0, 0.0}).y, -1.5e-9, 1e-21);
}

// What a sensor reports of Γ_App after an hour of the second session, which begins after the seven
// orbits of the first: b0 + ḃt + ([K1] + st) Γ_App, in its frame.
TEST(Realism, LetsBiasAndScaleFactorDrift) {
  Instrument instrument = make_instrument({});
  instrument.sensors[1].parasitic_K_m_s2 = {3e-8, -2e-8, 1e-8};
  RealismConfig config;
  config.bias_drift_m_s3 = {0.0, 2e-13};
  config.scale_drift_per_s = {0.0, 1e-7};
  Scenario scenario = scenario_with(config);
  scenario.sessions[0].num_orbits = 7;
  const double t_s = 7 * scenario.orbit.period_s + 3600;
  LoopConstants<double> constants = constants_of(scenario, instrument);
  Realism realism(scenario, instrument, constants, 1, 0);
  for (int k = 0; k <= 14400; ++k) realism.begin_sample(constants);
  const Vector3<double> applied_S{5e-8, 0.0, -7e-8};
  const Vector3<double> measured = measured_acceleration(
      constants.sensors[1], applied_S + constants.sensors[1].parasitic_K_m_s2);
  EXPECT_NEAR(measured.x, 2e-13 * t_s + (1.0 + 1e-7 * t_s) * 5e-8, 1e-20);
  EXPECT_NEAR(measured.y, 2e-13 * t_s, 1e-20);
  EXPECT_NEAR(measured.z, 2e-13 * t_s - (1.0 + 1e-7 * t_s) * 7e-8, 1e-20);
  EXPECT_EQ(measured_acceleration(constants.sensors[0], applied_S).x, 5e-8);
}

TEST(Realism, RefusesWhatIsNoTensorOfInertia) {
  RealismConfig config = with_inertia();
  EXPECT_NO_THROW(config.validate());
  config.inertia_kg_m2 = {10.0, 111.0, 75.0};  // 10 + 75 < 111.
  EXPECT_THROW(config.validate(), ConfigError);
  config = with_inertia();
  config.inertia_products_kg_m2[0] = 100.0;  // Not positive definite.
  EXPECT_THROW(config.validate(), ConfigError);
  config = {};
  config.thrust_arm_m[0] = 0.01;  // Without [J].
  EXPECT_THROW(config.validate(), ConfigError);
  config = with_inertia();
  config.thrust_arm_m[0] = 0.01;  // Without a mass.
  EXPECT_THROW(config.validate(), ConfigError);
}

}  // namespace
}  // namespace proofmass
