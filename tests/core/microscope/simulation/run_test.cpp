#include "core/microscope/simulation/run.hpp"

#include "core/microscope/session/session.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/runs.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

/// The paper's sessions cut to `num_orbits` each: the same code path in a fraction of the time.
MicroscopeCampaign short_campaign(int num_orbits) {
  MicroscopeCampaign campaign;
  campaign.seed = 7;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = num_orbits;
  campaign.validate();
  return campaign;
}

TEST(RunPlan, RepeatsARunBitForBitAfterOthersAndInAnotherPlan) {
  const MicroscopeCampaign campaign = short_campaign(2);
  const RunPlan plan(campaign);
  const RunResult alone = plan.simulate(RunIndex{5}, {});
  (void)plan.simulate(RunIndex{0}, {});
  EXPECT_EQ(test::bits_of(plan.simulate(RunIndex{5}, {})), test::bits_of(alone));
  EXPECT_EQ(test::bits_of(RunPlan(campaign).simulate(RunIndex{5}, {})), test::bits_of(alone));
}

// Sessions draw from streams of their own names, so the estimate that one session alone determines
// in the first round does not move when the sessions are put in another order.
TEST(RunPlan, DoesNotDependOnTheOrderOfSessions) {
  MicroscopeCampaign campaign = short_campaign(1);
  const RunResult before = RunPlan(campaign).simulate(RunIndex{3}, {});
  std::swap(campaign.scenario.sessions.front(), campaign.scenario.sessions.back());
  const RunResult after = RunPlan(campaign).simulate(RunIndex{3}, {});
  EXPECT_EQ(after.truth, before.truth);
  EXPECT_EQ(after.estimate, before.estimate);
}

RecordNeeds needs_of_test(const Session& /*session*/) { return {}; }
void refuse_nothing(const std::vector<Session>& /*sessions*/) {}

/// What a method was given, as its estimates; its rounds and convergence are its own.
Estimation first_phasors(const RunPhasors& records, const EstimationInput& input) {
  Estimation estimation{.num_rounds = 3, .converged = input.config.convergence < 0.5};
  for (std::size_t i = 0; i < num_parameters; ++i) {
    estimation.values[i] = records[i].amplitude[index(Signal::differential_x)][0].real();
  }
  return estimation;
}

// A run is what the method makes of its records, one for each session in the scenario's order.
TEST(RunPlan, EstimatesByTheMethodThatItIsGiven) {
  constexpr EstimationMethodInfo method{"first_phasors", needs_of_test, refuse_nothing,
                                        first_phasors};
  MicroscopeCampaign campaign = short_campaign(1);
  std::swap(campaign.scenario.sessions[0], campaign.scenario.sessions[7]);
  const RunPlan plan(campaign, method);
  const RunRecord record = plan.record(RunIndex{0}, {});
  ASSERT_EQ(record.phasors.size(), 11U);
  const RunResult result = plan.estimate(record);
  EXPECT_EQ(result.status, RunStatus::completed);
  EXPECT_EQ(result.num_rounds, 3U);
  for (std::size_t i = 0; i < num_parameters; ++i) {
    EXPECT_EQ(result.estimate[i],
              record.phasors[i].amplitude[index(Signal::differential_x)][0].real());
  }
  // Each session's stream bears its name: a swap of two moves their records and nothing else.
  std::swap(campaign.scenario.sessions[0], campaign.scenario.sessions[7]);
  const RunRecord other = RunPlan(campaign, method).record(RunIndex{0}, {});
  EXPECT_EQ(other.phasors[7].amplitude, record.phasors[0].amplitude);
  EXPECT_EQ(other.phasors[3].amplitude, record.phasors[3].amplitude);
  EXPECT_TRUE(result.standard_error.empty());
  campaign.scenario.estimation.convergence = 0.7;
  EXPECT_EQ(RunPlan(campaign, method).simulate(RunIndex{0}, {}).status, RunStatus::not_converged);
}

Estimation errors_of_three(const RunPhasors& /*records*/, const EstimationInput& input) {
  Estimation estimation{.num_rounds = 1, .converged = true};
  estimation.standard_errors.fill(3e-9);
  estimation.session_fits = {{1.25, 1.5}, {2.5, 2.5}};
  estimation.correlations[1][2] = 0.1234567;
  if (input.config.convergence > 0.5) estimation.standard_errors.back() = HUGE_VAL;
  return estimation;
}

// What a method says of its errors reaches the result; and the schema has a place for it.
TEST(RunPlan, PassesStandardErrorsOnIfTheMethodHasThem) {
  constexpr EstimationMethodInfo method{.name = "errors_of_three",
                                        .needs = needs_of_test,
                                        .check = refuse_nothing,
                                        .estimate = errors_of_three,
                                        .has_standard_errors = true};
  MicroscopeCampaign campaign = short_campaign(1);
  const RunResult result = RunPlan(campaign, method).simulate(RunIndex{0}, {});
  EXPECT_EQ(result.status, RunStatus::completed);
  EXPECT_EQ(result.standard_error, std::vector<double>(num_parameters, 3e-9));
  EXPECT_EQ(result.fit, (std::vector<double>{3.75, 4.0, 1.25, 1.5, 2.5, 2.5}));
  ASSERT_EQ(result.correlations.size(), num_correlations(results_with_errors()));
  EXPECT_EQ(result.correlations[9], 0.123457);  // Of the second with the third.
  campaign.scenario.estimation.convergence = 0.7;
  const RunResult unusable = RunPlan(campaign, method).simulate(RunIndex{0}, {});
  EXPECT_EQ(unusable.status, RunStatus::not_finite);
  EXPECT_TRUE(unusable.standard_error.empty());
}

// Two sessions of a target, each with noise of its own, give an estimate between those of each.
TEST(RunPlan, EstimatesATargetFromSeveralSessions) {
  constexpr std::size_t at_a_d12 = index(SessionTarget::a_d12), i = index(Parameter::a_d12);
  MicroscopeCampaign campaign = short_campaign(2);
  const double of_first = RunPlan(campaign).simulate(RunIndex{0}, {}).estimate[i];
  const Session first = campaign.scenario.sessions[at_a_d12];
  campaign.scenario.sessions[at_a_d12].name = "again";
  const double of_second = RunPlan(campaign).simulate(RunIndex{0}, {}).estimate[i];
  campaign.scenario.sessions.insert(campaign.scenario.sessions.begin(), first);
  campaign.validate();
  const RunResult of_both = RunPlan(campaign).simulate(RunIndex{0}, {});
  EXPECT_EQ(of_both.status, RunStatus::completed);
  EXPECT_GT(of_both.estimate[i], std::min(of_first, of_second));
  EXPECT_LT(of_both.estimate[i], std::max(of_first, of_second));
}

// A session without target is recorded and its loops are watched, but no estimate hangs on it.
TEST(RunPlan, RecordsASessionWithoutTargetBesideTheOthers) {
  MicroscopeCampaign campaign = short_campaign(1);
  const RunResult before = RunPlan(campaign).simulate(RunIndex{0}, {});
  Session spun = campaign.scenario.sessions[0];
  spun.name = "spun";
  spun.target = SessionTarget::no_target;
  spun.spin_rate_rad_s = 4.75e-3;
  campaign.scenario.sessions.push_back(spun);
  campaign.validate();
  const RunPlan plan(campaign);
  const RunRecord record = plan.record(RunIndex{0}, {});
  ASSERT_EQ(record.phasors.size(), 12U);
  EXPECT_NE(record.phasors[11].amplitude[index(Signal::gradient_xx)][0], 0.0);
  EXPECT_EQ(plan.estimate(record).estimate, before.estimate);
  EXPECT_GT(test::health_of(plan.estimate(record)).residual_m_s2,
            2.0 * test::health_of(before).residual_m_s2);
}

/// Every session of one orbit, with fifty times the loop gain along X.
MicroscopeCampaign unstable_campaign() {
  MicroscopeCampaign campaign = short_campaign(1);
  test::fix(campaign, "thruster_scale_error.x", 50.0);
  return campaign;
}

// A drag-free loop beyond its stability limit grows without bound, unless a sensor's range ends it.
TEST(RunPlan, SaysWhenTheSimulationDiverges) {
  MicroscopeCampaign campaign = unstable_campaign();
  campaign.scenario.sensor.range_m_s2 = 1e80;
  const RunResult result = RunPlan(campaign).simulate(RunIndex{0}, {});
  EXPECT_EQ(result.status, RunStatus::lost);
  EXPECT_EQ(result.loss.cause, static_cast<std::uint32_t>(LossCause::saturation));
  EXPECT_EQ(test::health_of(result).acceleration_m_s2, magnitude_max);
  EXPECT_FALSE(result.has_estimate());
  EXPECT_TRUE(result.has_truth());
}

TEST(RunPlan, SaysWhenASensorReachesTheEndOfItsRange) {
  const RunResult result = RunPlan(unstable_campaign()).simulate(RunIndex{0}, {});
  EXPECT_EQ(result.status, RunStatus::lost);
  EXPECT_EQ(result.loss, test::loss_of(LossCause::saturation, SessionTarget::a_c11_delta_x));
  EXPECT_GT(test::health_of(result).acceleration_m_s2, 1e-5);
  EXPECT_FALSE(result.has_estimate());
  EXPECT_TRUE(result.has_truth());
}

// What the loops reach in the nominal campaign, by magnitude: millimetres from the centre of mass
// and mass motion make 1e-7 m/s², biases of 10 arcsec some 5e-5 rad, the environment 1e-12 m/s².
TEST(RunPlan, ReportsTheHealthOfItsLoops) {
  const RunResult result = RunPlan(short_campaign(2)).simulate(RunIndex{0}, {});
  EXPECT_EQ(result.status, RunStatus::completed);
  EXPECT_EQ(result.loss.cause, static_cast<std::uint32_t>(LossCause::none));
  EXPECT_GT(test::health_of(result).acceleration_m_s2, 2e-8);
  EXPECT_LT(test::health_of(result).acceleration_m_s2, 2e-7);
  EXPECT_GT(test::health_of(result).attitude_rad, 1e-6);
  EXPECT_LT(test::health_of(result).attitude_rad, 2e-4);
  EXPECT_GT(test::health_of(result).residual_m_s2, 3e-13);
  EXPECT_LT(test::health_of(result).residual_m_s2, 3e-12);
  EXPECT_GT(test::health_of(result).quadratic_noise, 0.0);
  EXPECT_LT(test::health_of(result).quadratic_noise, 0.01);
  EXPECT_GT(test::health_of(result).square_noise, 0.0);
  EXPECT_LT(test::health_of(result).square_noise, 1e-4);
}

// What a record tells of its loops is made worse until an estimate may be off by its objective.
TEST(RunPlan, SaysWhatLostARunAndWhichEstimateIsOff) {
  using enum SessionTarget;
  const RunPlan plan(short_campaign(1));
  const RunRecord record = plan.record(RunIndex{0}, {});
  const auto loss_with = [&](const std::function<void(SessionHealth&)>& spoil) {
    RunRecord spoiled = record;
    for (SessionHealth& health : spoiled.health) spoil(health);
    const RunResult result = plan.estimate(spoiled);
    EXPECT_EQ(result.status, RunStatus::lost);
    return result.loss;
  };
  EXPECT_EQ(loss_with([](SessionHealth& h) { h.acceleration_m_s2 = 2e-5; }),
            test::loss_of(LossCause::saturation, a_c11_delta_x));
  EXPECT_EQ(loss_with([](SessionHealth& h) { h.attitude_rad = 0.05; }),
            test::loss_of(LossCause::attitude, a_c12));
  EXPECT_EQ(loss_with([](SessionHealth& h) {
              h.monitor.residual = {{{1e-7, 0.0}, {}, {}}};
            }),
            test::loss_of(LossCause::residual, a_c11_delta_x));
  EXPECT_EQ(loss_with([](SessionHealth& h) { h.monitor.quadratic.squares *= 1e7; }),
            test::loss_of(LossCause::quadratic_noise, a_c11_delta_x));
  EXPECT_EQ(loss_with([](SessionHealth& h) { h.monitor.common_square.squares *= 1e7; }),
            test::loss_of(LossCause::square_noise, k2d));
}

/// The largest part of an objective that noise of the quadratic terms may take, of those warned of.
double largest_part(const MicroscopeCampaign& of) {
  double largest = 0.0;
  for (const Warning& warning : of.warner()(RunPlan(of).simulate(RunIndex{0}, {}))) {
    if (warning.effect == "quadratic_noise") largest = std::max(largest, warning.part);
  }
  return largest;
}

void fix_parasitic_accelerations(MicroscopeCampaign& campaign) {
  test::fix(campaign, "parasitic_acceleration_m_s2.sensor_1_x", -1.4e-8);
  test::fix(campaign, "parasitic_acceleration_m_s2.sensor_2_x", 1.4e-8);
}

// An offcentring moves the masses by a line at 2 f_orb, which 2 K2d b_1d turn into another: a scale
// factor, nearly, and no noise.
TEST(RunPlan, TakesTheLineOfAnOffcentringForNoNoise) {
  MicroscopeCampaign campaign = short_campaign(1);
  campaign.scenario.noise.scale = 0.0;
  test::fix(campaign, "quadratic_factor_s2_m.sensor_1_x", 10000.0);
  test::fix(campaign, "quadratic_factor_s2_m.sensor_2_x", -10000.0);
  test::fix(campaign, "offcentring_m.x", 20e-6);
  fix_parasitic_accelerations(campaign);
  EXPECT_EQ(largest_part(campaign), 0.0);
}

// Two metres from the centre of mass, the loop leaves 1.5e-9 m/s² of the gradient at 2 f_orb, which
// 2 K2c b_1d turn into a line that â_d11' takes away: it moves no estimate, although blocks of 512
// s step by it. Noise of the thrust does.
TEST(RunPlan, TakesAKnownLineOfTheGradientForNoNoise) {
  MicroscopeCampaign campaign = short_campaign(10);
  std::erase_if(campaign.scenario.sessions, [](const Session& session) {
    return session.target != SessionTarget::a_c11_delta_x &&
           session.target != SessionTarget::a_d11_prime &&
           session.target != SessionTarget::k2_sensor_1 &&
           session.target != SessionTarget::k2_sensor_2;
  });
  campaign.scenario.noise.scale = 0.0;
  campaign.scenario.sensor.position_m = {2.0, 0.0, 0.0};
  for (const std::string sensor : {"sensor_1_x", "sensor_2_x"}) {
    test::fix(campaign, "quadratic_factor_s2_m." + sensor, 14000.0);
  }
  fix_parasitic_accelerations(campaign);
  EXPECT_EQ(largest_part(campaign), 0.0);
  campaign.scenario.noise.scale = 1.0;
  campaign.scenario.noise.thrust_asd_m_s2 = 1e-6;
  EXPECT_GT(largest_part(campaign), 0.3);
}

// Estimates are linear in the measured difference.
TEST(RunPlan, SaysWhenAnEstimateIsOutOfRange) {
  const MicroscopeCampaign campaign = short_campaign(1);
  const RunPlan plan(campaign);
  RunRecord record = plan.record(RunIndex{0}, {});
  EXPECT_TRUE(plan.estimate(record).has_estimate());
  for (SessionPhasors& session : record.phasors) {
    for (auto& amplitude : session.amplitude[index(Signal::differential_x)]) amplitude *= 1e110;
  }
  EXPECT_EQ(plan.estimate(record).status, RunStatus::not_finite);
}

TEST(RunPlan, SaysWhenEstimatesStillMoveInTheLastRound) {
  MicroscopeCampaign campaign = short_campaign(1);
  campaign.scenario.estimation.num_rounds_max = 1;
  const RunResult result = RunPlan(campaign).simulate(RunIndex{0}, {});
  EXPECT_EQ(result.status, RunStatus::not_converged);
  EXPECT_EQ(result.num_rounds, 1U);
  EXPECT_TRUE(result.has_estimate());
}

}  // namespace
}  // namespace proofmass
