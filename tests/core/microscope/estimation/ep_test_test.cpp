// The test of the equivalence principle against what it has to find in closed form, and whether its
// standard errors are honest.

#include "core/microscope/estimation/ep_test/ep_test.hpp"

#include "core/math/instruction_set.hpp"
#include "core/microscope/campaign/budget.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/signal/noise_shape.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/runs.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

using test::fix;

constexpr double orbit_s = 5950.0;
constexpr double f_orb_rad_s = 2.0 * std::numbers::pi / orbit_s;

Session test_session(std::string name, int num_orbits, double spin_in_orbits = 0.0) {
  Session session;
  session.name = std::move(name);
  session.target = SessionTarget::ep_test;
  session.num_orbits = num_orbits;
  session.spin_rate_rad_s = spin_in_orbits * f_orb_rad_s;
  return session;
}

/// Records tests alone, for an estimate with whatever is taken for the calibration.
constexpr EstimationMethodInfo no_calibration{
    .name = "none",
    .needs = [](const Session&) { return RecordNeeds{.signals = SignalSet::health}; },
    .check = [](const std::vector<Session>&) {},
    .estimate = [](const RunPhasors&, const EstimationInput&) { return Estimation{}; },
};

/// Without noise and errors of the instrument.
MicroscopeCampaign quiet_campaign(std::vector<Session> sessions) {
  MicroscopeCampaign campaign;
  campaign.scenario.sessions = std::move(sessions);
  campaign.scenario.noise.scale = 0.0;
  campaign.dispersions = test::perfect_laws();
  return campaign;
}

TestEstimation estimate(const MicroscopeCampaign& campaign, const RunRecord& record,
                        const ParameterArray& calibration = {}) {
  const Scenario& scenario = campaign.scenario;
  const DrawnMoments laws;
  return estimate_ep_test(record.phasors,
                          {.sessions = scenario.sessions,
                           .config = scenario.estimation,
                           .objectives = scenario.objectives,
                           .noise = scenario.noise,
                           .attitude = scenario.attitude,
                           .laws = laws,
                           .orbit_period_s = scenario.orbit.period_s,
                           .sample_period_s = scenario.simulation.sample_period_s},
                          Estimation{.values = calibration});
}

TestEstimation estimate(const MicroscopeCampaign& campaign) {
  return estimate(campaign, RunPlan(campaign, no_calibration).record(RunIndex{0}, {}));
}

/// On a circular orbit, where g_x has no line but f_EP, and gradients none but 2 f_EP.
MicroscopeCampaign circular_campaign() {
  MicroscopeCampaign campaign = quiet_campaign({test_session("ep", 2)});
  campaign.scenario.orbit.eccentricity = 0.0;
  return campaign;
}

/// In phase with g_x, amplitude over amplitude, both without their means: of a measurement that
/// `value` takes from each sample of the record.
/// @param axis  `z` for g_z, a quarter of a turn from g_x.
template <typename Value>
double in_phase(const MicroscopeCampaign& campaign, const Value& value,
                double Vector3<double>::*axis = &Vector3<double>::x) {
  double n = 0.0, g = 0.0, v = 0.0, gg = 0.0, gv = 0.0;
  const double axis_m = std::cbrt(3.986004418e14 / (f_orb_rad_s * f_orb_rad_s));
  const auto add = [&](const ObservedSample& sample) {
    if (sample.index < 0) return;
    const double radius_m =
        axis_m * std::cbrt(f_orb_rad_s * f_orb_rad_s / sample.shared.gradient_s2);
    const double gravity = -sample.shared.gradient_s2 * radius_m * sample.shared.radial_R.*axis;
    const double of = value(sample);
    n += 1.0;
    g += gravity;
    v += of;
    gg += gravity * gravity;
    gv += gravity * of;
  };
  (void)RunPlan(campaign, no_calibration).record(RunIndex{0}, {}, {}, add);
  return (gv - g * v / n) / (gg - g * g / n);
}

double common_x(const ObservedSample& sample) { return sample.signals[index(Signal::common_x)]; }
double common_y(const ObservedSample& sample) { return sample.signals[index(Signal::common_y)]; }
double common_z(const ObservedSample& sample) { return sample.signals[index(Signal::common_z)]; }

constexpr std::size_t delta = index(TestParameter::eotvos_parameter);
constexpr std::size_t delta_x = index(TestParameter::a_c11_delta_x);
constexpr std::size_t delta_z = index(TestParameter::a_c11_delta_z);
constexpr std::size_t uncorrected = index(TestParameter::uncorrected);

/// Glitches that follow everything at once, and some telemetry; two fifths of the windows are lost.
GapsConfig many_gaps() {
  return {.glitch_rate_hz = 0.02,
          .glitch_duration_s = 15.0,
          .orbital = {.depth = 0.2, .phase_rad = 1.0},
          .spin = {.depth = 0.3},
          .test = {.depth = 0.5, .phase_rad = -0.7},
          .telemetry_rate_hz = 1e-4,
          .telemetry_duration_s = 300.0};
}

// Γ_mes,dx is a sum of the regressors, a constant, and 1e-3 of δ that the averages and angles of
// mrad leave. Whatever windows count, the fit finds the sum.
TEST(EpTest, FindsViolationAndOffcentringsInEveryPointing) {
  const std::pair<GapsConfig, double> cases[]{{GapsConfig{}, 1e-17}, {many_gaps(), 2e-17}};
  for (const auto& [gaps, accuracy] : cases) {
    for (const double spin : {0.0, 4.5, -4.5, 17.5, -17.5}) {
      MicroscopeCampaign campaign = quiet_campaign({test_session("ep", 2, spin)});
      campaign.scenario.gaps = gaps;
      fix(campaign, "eotvos_parameter.masses_2_1", 1e-14);
      fix(campaign, "offcentring_m.x", 20e-6);
      fix(campaign, "offcentring_m.z", -10e-6);
      const TestEstimation found = estimate(campaign);
      EXPECT_NEAR(found.values[delta], 1e-14, accuracy) << spin;
      EXPECT_NEAR(found.values[delta_x], 20e-6, 1e-11) << spin;
      EXPECT_NEAR(found.values[delta_z], -10e-6, 1e-11) << spin;
    }
  }
}

TEST(EpTest, JoinsSessionsAndRemovesTheBiasOfEach) {
  Session locked = test_session("locked", 1, 4.5);
  locked.drag_free = DragFreeSource::sensor_2;
  MicroscopeCampaign campaign = quiet_campaign({test_session("inertial", 2), locked});
  fix(campaign, "eotvos_parameter.masses_2_1", -3e-14);
  fix(campaign, "read_out_bias_m_s2.sensor_1_x", 1e-8);
  EXPECT_NEAR(estimate(campaign).values[delta], -3e-14, 3e-17);
}

/// Expects that `budget` is taken for δ where the calibration knows nothing, and nothing is where
/// it knows the truth.
void expect_error(const MicroscopeCampaign& campaign, double budget) {
  const RunRecord record = RunPlan(campaign, no_calibration).record(RunIndex{0}, {});
  EXPECT_GT(std::abs(budget), 1e-17);
  EXPECT_NEAR(estimate(campaign, record).values[delta], budget, 0.01 * std::abs(budget));
  const TestEstimation calibrated = estimate(campaign, record, record.truth);
  EXPECT_NEAR(calibrated.values[delta], 0.0, 1e-18);
  EXPECT_NEAR(calibrated.values[uncorrected], budget, 0.01 * std::abs(budget));
}

// What a fit would state is of noise of scale 1, which is not there.
TEST(EpTest, HasNoStandardErrorsWithoutNoise) {
  EstimationMethodInfo method = no_calibration;
  method.has_standard_errors = true;
  MicroscopeCampaign campaign = circular_campaign();
  const RunResult quiet = RunPlan(campaign, method).simulate(RunIndex{0}, {});
  EXPECT_EQ(quiet.estimate.size(), num_parameters + num_test_parameters);
  EXPECT_TRUE(quiet.standard_error.empty() && quiet.correlations.empty() && quiet.fit.empty());
  campaign.scenario.noise.scale = 1.0;
  const RunResult noisy = RunPlan(campaign, method).simulate(RunIndex{0}, {});
  EXPECT_EQ(noisy.standard_error.size(), num_parameters + 1);
  EXPECT_GE(noisy.fit.size(), 2U);
}

/// Leaves ten windows within two percent of the record, with noise in every signal. The sums have
/// no digit left of what a cubic polynomial does not take.
void leave_a_stretch(SessionPhasors& record) {
  std::ranges::fill(record.test_products, 0.0);
  for (int window = 0; window < 10; ++window) {
    std::array<double, num_test_signals> signals{};
    for (std::size_t i = 0; i < num_test_signals; ++i) {
      signals[i] = i < num_powers ? std::pow(0.5 + 0.002 * window, static_cast<double>(i))
                                  : 8.0 + std::cos(static_cast<double>(i) * window);
    }
    for (std::size_t k = 0; k < num_test_products; ++k) {
      const auto [i, j] = test_product_pairs[k];
      record.test_products[k] += signals[i] * signals[j];
    }
  }
}

// Whatever else a mission has, a test whose data are lost tells nothing and takes nothing away.
TEST(EpTest, DoesWithoutASessionThatLostAllData) {
  MicroscopeCampaign campaign = quiet_campaign({test_session("lost", 2), test_session("kept", 2)});
  fix(campaign, "eotvos_parameter.masses_2_1", 1e-12);
  const RunRecord whole = RunPlan(campaign, no_calibration).record(RunIndex{0}, {});
  RunRecord record = whole;
  std::ranges::fill(record.phasors[0].test_products, 0.0);
  const double found = estimate(campaign, record).values[delta];
  EXPECT_NEAR(found / 1e-12, 1.0, 1e-3);
  leave_a_stretch(record.phasors[0]);
  EXPECT_EQ(estimate(campaign, record).values[delta], found);
  std::ranges::fill(record.phasors[1].test_products, 0.0);
  EXPECT_FALSE(std::isfinite(estimate(campaign, record).values[delta]));
}

// Γ_mes,dx holds a_d11 Γ_mes,cx, so that 2 a_d11 Γ_res,x is taken for δ g.
TEST(EpTest, HasTheErrorOfAScaleFactorInItsBudget) {
  MicroscopeCampaign campaign = circular_campaign();
  fix(campaign, "scale_factor_error.sensor_1_x", 5e-3);
  fix(campaign, "scale_factor_error.sensor_2_x", -5e-3);
  expect_error(campaign, 2.0 * 5e-3 * in_phase(campaign, common_x));
}

// The loop of 2013 leaves 3e-10 m/s² at 3.1 mHz, so that an uncalibrated scale factor makes 1e-13
// of δ there. With a resonator it leaves less than a thousandth of the budget's 1e-12 m/s².
TEST(EpTest, IsFreeOfTheDragAtItsFrequencyWithAResonator) {
  MicroscopeCampaign campaign = quiet_campaign({test_session("ep", 2, 17.5)});
  campaign.scenario.orbit.eccentricity = 0.0;
  fix(campaign, "scale_factor_error.sensor_1_x", 5e-3);
  fix(campaign, "scale_factor_error.sensor_2_x", -5e-3);
  const auto residual_m_s2 = [&](const auto& common) {
    const double gravity_m_s2 = std::cbrt(3.986004418e14 * std::pow(f_orb_rad_s, 4.0));
    return gravity_m_s2 *
           std::hypot(in_phase(campaign, common), in_phase(campaign, common, &Vector3<double>::z));
  };
  for (const auto common : {common_x, common_z}) {  // What acts along Y does not turn with S.
    EXPECT_NEAR(residual_m_s2(common), 3e-10, 1e-10);
  }
  const RunPlan plan(campaign, no_calibration);
  const RunResult result = plan.estimate(plan.record(RunIndex{0}, {}));
  const double largest = std::max(residual_m_s2(common_x), residual_m_s2(common_z));
  // Lines at 17.5 and 19.5 f_orb, which are no larger, are orthogonal to the gravity, but for the
  // ends, where weights take less than five windows from the record.
  constexpr double part = 2.0 * 2.0 * 5.0 / 2974.0;
  EXPECT_NEAR(result.health.at(num_health_values), largest, part * largest);
  EXPECT_EQ(test::health_of(result).residual_m_s2, 0.0);
  EXPECT_GT(std::abs(estimate(campaign).values[delta]), 1e-14);
  campaign.scenario.drag_free.resonator_damping = 0.5;
  for (const auto common : {common_x, common_y, common_z}) {
    EXPECT_LT(residual_m_s2(common), 1e-15);
  }
  // What is left along X is of those lines, 3e-11 m/s² at the most.
  EXPECT_LT(std::abs(estimate(campaign).values[delta]), 2.0 * 5e-3 * part * 3e-11 / 7.9);
}

// 2 a_d12 Γ_res,y.
TEST(EpTest, HasTheErrorOfAMisalignmentInItsBudget) {
  MicroscopeCampaign campaign = circular_campaign();
  campaign.scenario.environment.linear_y.orbital = 1e-8;
  campaign.scenario.environment.linear_y.orbital_phase_rad = 0.0;
  fix(campaign, "misalignment_rad.sensor_1_z", 1e-3);
  fix(campaign, "misalignment_rad.sensor_2_z", -1e-3);
  expect_error(campaign, 2.0 * 1e-3 * in_phase(campaign, common_y));
}

// 4 K2c Γ_d Γ_res,x, of a constant Γ_d. a_d11' takes it up.
TEST(EpTest, HasTheErrorOfAQuadraticFactorInItsBudget) {
  MicroscopeCampaign campaign = circular_campaign();
  for (const int sensor : {1, 2}) {
    fix(campaign, "quadratic_factor_s2_m.sensor_" + std::to_string(sensor) + "_x", 14000.0);
    fix(campaign, "parasitic_acceleration_m_s2.sensor_" + std::to_string(sensor) + "_x",
        sensor == 1 ? -1.43e-8 : 1.43e-8);
  }
  expect_error(campaign, 4.0 * 14000.0 * 1.43e-8 * in_phase(campaign, common_x));
}

// a_c12 T_yy Δy, whose gradient the orbit's eccentricity makes.
TEST(EpTest, HasTheErrorOfAnOffcentringAcrossInItsBudget) {
  MicroscopeCampaign campaign = quiet_campaign({test_session("ep", 2)});
  fix(campaign, "offcentring_m.y", 20e-6);
  for (const int sensor : {1, 2}) {
    fix(campaign, "misalignment_rad.sensor_" + std::to_string(sensor) + "_z", 2e-3);
  }
  const RunRecord record = RunPlan(campaign, no_calibration).record(RunIndex{0}, {});
  const double gravity =
      3.986004418e14 / std::pow(3.986004418e14 / (f_orb_rad_s * f_orb_rad_s), 2.0 / 3.0);
  const double budget = test_gradient_levels(campaign.scenario).yy * 2e-3 * 20e-6 / gravity;
  EXPECT_NEAR(std::abs(estimate(campaign, record).values[delta]), budget, 0.01 * budget);
  EXPECT_NEAR(estimate(campaign, record, record.truth).values[delta], 0.0, 1e-18);
}

// White noise, from the covariance of windows that overlap by half: its density at a low frequency
// is that of the samples, and half of it goes where neighbours are half a turn apart.
TEST(WindowNoise, IsThatOfTheWindowsWeights) {
  const SensorNoise white{.white_asd = 1e-12};
  constexpr double period_s = 0.25, window_s = 16 * period_s;
  std::array<double, 32> weights{};
  for (std::size_t k = 0; k < 16; ++k) {
    weights[k] = (static_cast<double>(k) + 0.5) / 256.0;
    weights[31 - k] = weights[k];
  }
  double square = 0.0, neighbour = 0.0;
  for (std::size_t k = 0; k < 32; ++k) {
    square += weights[k] * weights[k];
    if (k < 16) neighbour += weights[k] * weights[k + 16];
  }
  const double variance = 0.5 * 1e-24 / (2.0 * period_s);
  for (const double f : {1e-4, 3.1e-3, 0.05, 0.12}) {
    const double turn = 2.0 * std::numbers::pi * f * window_s;
    const double expected = 2.0 * window_s * variance * (square + 2.0 * neighbour * std::cos(turn));
    EXPECT_NEAR(window_noise_psd(white, f, period_s), expected, 1e-9 * expected) << f;
  }
}

/// Random instruments, noise, and the truth as the calibration.
struct Coverage {
  double within_95 = 0.0;
  double rms = 0.0;  ///< Of error over standard error.
};

/// Of the Eötvös parameter in 208 runs.
/// @param axes  Of every instrument's offcentring; along others it is drawn.
Coverage coverage(double spin, const NoiseConfig& noise, const GapsConfig& gaps,
                  std::string_view axes = "", double offcentring_m = 0.0) {
  constexpr std::uint64_t num_runs = 208;
  MicroscopeCampaign campaign;
  campaign.scenario.noise = noise;
  campaign.scenario.sessions = {test_session("ep", 2, spin)};
  campaign.scenario.gaps = gaps;
  for (const char axis : axes) fix(campaign, std::string("offcentring_m.") + axis, offcentring_m);
  Coverage found;
  for (const RunRecord& record : test::recorded(RunPlan(campaign, no_calibration), num_runs)) {
    const TestEstimation test = estimate(campaign, record, record.truth);
    constexpr std::size_t eotvos = index(TestParameter::eotvos_parameter);
    const double ratio = (test.values[eotvos] - record.eotvos_parameter) / test.standard_error;
    if (std::abs(ratio) < 1.959964) found.within_95 += 1.0 / num_runs;
    found.rms += ratio * ratio / num_runs;
  }
  found.rms = std::sqrt(found.rms);
  return found;
}

// Of all data and of what gaps leave, where the formula for lines would be exceeded by half in the
// mean; with noise of wires that differs in both sensors by a factor of ten in density; and with
// noise that rises from 5 to 50 mHz, which the ends of a record let in if all windows count alike:
// the rms would be 1.57. Three binomial deviations; the deviation of the rms is 1/√(2·208).
TEST(EpTest, HasAnHonestStandardError) {
  NoiseConfig of_each_sensor = noise_preset(NoisePreset::wire_suref);
  of_each_sensor.linear_factor = {1.0, 0.5};
  NoiseConfig rising;
  rising.linear_x.rise_corner_hz = 5e-3;
  rising.linear_x.rise_limit_hz = 0.05;
  NoiseConfig slow = rising;  // What is left of it after sixteen windows is a thirtieth.
  slow.linear_x.rise_corner_hz = 3e-3;
  slow.linear_x.rise_limit_hz = 0.012;
  NoiseConfig loud;  // The squares that are subtracted have twice as much: the rms would be 1.75.
  loud.scale = 24.0;
  for (const GapsConfig& gaps : {GapsConfig{}, many_gaps()}) {
    for (const auto& [spin, noise] : {std::pair(0.0, NoiseConfig{}), std::pair(17.5, NoiseConfig{}),
                                      std::pair(17.5, of_each_sensor), std::pair(17.5, rising),
                                      std::pair(0.0, slow), std::pair(0.0, loud)}) {
      const Coverage found = coverage(spin, noise, gaps);
      EXPECT_NEAR(found.within_95, 0.95, 3.0 * std::sqrt(0.95 * 0.05 / 208)) << spin;
      EXPECT_NEAR(found.rms, 1.0, 3.5 / std::sqrt(2.0 * 208)) << spin;
    }
  }
}

// At 0.6 mm the noise of the estimated attitude times the offcentring is 2.8 times that of the
// sensors: without it the rms would be 1.95. Along Y it is that of the rates about X, which have
// the angles about Z in a frame that turns: without these the rms would be 1.54.
TEST(EpTest, CountsTheNoiseOfTheAttitudeInItsStandardError) {
  EXPECT_NEAR(coverage(17.5, {}, {}, "xyz", 6e-4).rms, 1.0, 3.5 / std::sqrt(2.0 * 208));
  EXPECT_NEAR(coverage(17.5, {}, {}, "y", 1e-3).rms, 1.0, 3.5 / std::sqrt(2.0 * 208));
}

// The squares of what a loop leaves of thirty times the drag have lines as large as the noise of a
// window, of which differences keep 1e-6: taken for noise, they would make σ 2.3 times as large.
// So have those of the gradient's line, at twice f_EP, 20 cm along X from the centre of mass.
TEST(EpTest, TakesNoLineForNoise) {
  for (const GapsConfig& gaps : {GapsConfig{}, many_gaps()}) {
    double sigma = 0.0;
    for (const auto& [drag, position_x_m] :
         {std::pair(1.0, 0.0), std::pair(30.0, 0.0), std::pair(1.0, 0.2)}) {
      MicroscopeCampaign campaign;
      campaign.scenario.environment.scale = drag;
      campaign.scenario.sensor.position_m[0] = position_x_m;
      campaign.scenario.sessions = {test_session("ep", 2, 17.5)};
      campaign.scenario.gaps = gaps;
      double variance = 0.0;
      for (const RunRecord& record : test::recorded(RunPlan(campaign, no_calibration), 16)) {
        const double of_run = estimate(campaign, record, record.truth).standard_error;
        variance += of_run * of_run / 16.0;
      }
      if (sigma == 0.0) sigma = std::sqrt(variance);
      EXPECT_NEAR(std::sqrt(variance) / sigma, 1.0, 0.01);
    }
  }
}

/// A test whose loop nulls the outer mass, calibrated by the truth.
double error_on_the_outer_mass(DragFreeSource of_calibration, double offcentring_m = 0.0) {
  MicroscopeCampaign campaign = quiet_campaign({test_session("ep", 2, 17.5)});
  campaign.scenario.sessions[0].drag_free = DragFreeSource::sensor_2;
  Session calibration = hardy2013_sessions()[5];
  calibration.num_orbits = 1;
  calibration.drag_free = of_calibration;
  campaign.scenario.sessions.push_back(calibration);
  campaign.scenario.sensor.position_m = {0.0, 0.17, 0.0};
  fix(campaign, "offcentring_m.x", offcentring_m);
  fix(campaign, "quadratic_factor_s2_m.sensor_1_x", 14000.0);
  fix(campaign, "quadratic_factor_s2_m.sensor_2_x", -14000.0);
  fix(campaign, "parasitic_acceleration_m_s2.sensor_1_x", -1.4e-8);
  fix(campaign, "parasitic_acceleration_m_s2.sensor_2_x", 1.4e-8);
  const RunRecord record = RunPlan(campaign, no_calibration).record(RunIndex{0}, {});
  return estimate(campaign, record, record.truth).values[delta];
}

// With Γ_App,c = b_1d in the test, 2 K2d b_1d = 3.9e-4 belongs to its a_d11'. It multiplies the
// 3e-10 m/s² that the loop leaves at f_EP.
TEST(EpTest, NeedsADPrimeOfItsOwnDragFreePoint) {
  EXPECT_LT(std::abs(error_on_the_outer_mass(DragFreeSource::sensor_2)), 5e-16);
  EXPECT_GT(std::abs(error_on_the_outer_mass(DragFreeSource::common)), 5e-15);
}

// The centrifugal acceleration ½Ω²Δx of a test is in Γ_App,c then, as it is in Γ_App,d, but not in
// a calibration that does not spin: 2 K2d ½Ω²Δx of 1.9e-4.
TEST(EpTest, KnowsTheCentrifugalAccelerationOnTheOuterMass) {
  EXPECT_LT(std::abs(error_on_the_outer_mass(DragFreeSource::sensor_2, 40e-6)), 5e-16);
}

TEST(EpTest, FindsAViolationFarFromTheCentreOfMassOnTheOuterMass) {
  MicroscopeCampaign campaign = quiet_campaign({test_session("ep", 2, 17.5)});
  campaign.scenario.sessions[0].drag_free = DragFreeSource::sensor_2;
  campaign.scenario.sensor.position_m = {0.0, 0.17, 0.0};
  fix(campaign, "eotvos_parameter.masses_2_1", 1e-14);
  fix(campaign, "offcentring_m.x", 35e-6);
  EXPECT_NEAR(estimate(campaign).values[delta], 1e-14, 1e-17);
  EXPECT_NEAR(estimate(campaign).values[delta_x], 35e-6, 1e-11);
}

TEST(EpTest, HasTheSameBitsOnEveryInstructionSet) {
  MicroscopeCampaign campaign;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 1;
  campaign.scenario.simulation.sample_period_s = 1.0;
  campaign.scenario.simulation.settling_s = 400.0;
  auto& sessions = campaign.scenario.sessions;
  sessions.insert(sessions.begin(), test_session("first", 1, -4.5));
  sessions.push_back(test_session("last", 1));
  campaign.dispersions[index_of_eotvos_parameter].law = Law::uniform;
  campaign.dispersions[index_of_eotvos_parameter].minimum = -1e-13;
  campaign.dispersions[index_of_eotvos_parameter].maximum = 1e-13;
  campaign.scenario.gaps.glitch_rate_hz = 2e-3;
  campaign.scenario.drag_free.resonator_damping = 0.5;
  for (const char* method : {"hardy2013", "joint"}) {
    for (std::size_t i = 0; i < estimation_methods().size(); ++i) {
      if (estimation_methods()[i].name == method) {
        campaign.scenario.estimation.method = static_cast<EstimationMethod>(i + 1);
      }
    }
    campaign.validate();
    const RunPlan plan(campaign);
    EXPECT_FALSE(plan.runs_on_devices());
    const std::vector<RunRequest> requests = test::requests_from(0, batch_lanes);
    const std::vector<RunResult> alone =
        plan.simulate_batch(std::span(requests).first(3), InstructionSet::scalar);
    for (const InstructionSet set : available_instruction_sets()) {
      if (set == InstructionSet::scalar) continue;
      for (const std::size_t size : {std::size_t{3}, batch_lanes}) {
        const auto batch = plan.simulate_batch(std::span(requests).first(size), set);
        for (std::size_t i = 0; i < alone.size(); ++i) {
          EXPECT_EQ(test::bits_of(batch[i]), test::bits_of(alone[i]));
        }
      }
    }
    for (const RunResult& result : alone) {
      EXPECT_EQ(result.estimate.size(), campaign.results().quantities.size());
      EXPECT_EQ(result.truth.size(), campaign.results().quantities.size());
      EXPECT_EQ(result.correlations.size(), num_correlations(campaign.results()));
    }
  }
}

// What a calibration estimates does not depend on the tests beside it.
TEST(EpTest, LeavesTheCalibrationAlone) {
  MicroscopeCampaign campaign;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 1;
  MicroscopeCampaign mission = campaign;
  mission.scenario.sessions.insert(mission.scenario.sessions.begin(), test_session("ep", 1));
  const RunResult without = RunPlan(campaign).simulate(RunIndex{0}, {});
  const RunResult with = RunPlan(mission).simulate(RunIndex{0}, {});
  ASSERT_EQ(with.estimate.size(), num_parameters + num_test_parameters);
  for (std::size_t i = 0; i < num_parameters; ++i) {
    EXPECT_EQ(with.estimate[i], without.estimate[i]);
    EXPECT_EQ(with.truth[i], without.truth[i]);
  }
  EXPECT_EQ(test::health_of(with), test::health_of(without));
  // What the errors leave in a test depends on the loops of the test, and on the calibration.
  RunResult alike = with;
  alike.health.at(num_health_values) = test::health_of(without).residual_m_s2;
  EXPECT_EQ(mission.error_budget()->of_run(alike).total,
            campaign.error_budget()->of_run(without).total);
}

}  // namespace
}  // namespace proofmass
