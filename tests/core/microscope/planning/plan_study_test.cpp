// The bound of a plan against closed forms, and against the standard errors and the errors of
// simulated runs.

#include "core/microscope/planning/plan_study.hpp"

#include "core/campaign/allocation.hpp"
#include "core/error.hpp"
#include "core/microscope/campaign/budget.hpp"
#include "core/microscope/campaign/regressor_lines.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/estimation/joint/joint.hpp"
#include "core/microscope/estimation/methods.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/signal/periodogram.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/parse_campaign.hpp"
#include "tests/support/runs.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr double turn_rad = 2.0 * std::numbers::pi;

/// An instrument without errors, whose sensors have white noise.
MicroscopeCampaign perfect_campaign() {
  MicroscopeCampaign campaign = test::coarse_campaign();
  campaign.dispersions = test::perfect_laws();
  campaign.scenario.noise.linear_x = {.white_asd = 1e-12};
  return campaign;
}

// Γ_mes,dx = a_d12 Γ_mes,cy with the amplitude C: cosine and sine have the variance ½A²/T each, of
// which the part in phase tells, so that σ = A/(C √(2T)). The loop follows C_y to L/(1 + L), L as
// in [Hardy2013] 5.1: f_c/f at 40 times f. The low-pass takes as much of the noise as of the line.
TEST(PlanStudy, IsTheClosedFormOfOneLineInWhiteNoise) {
  const MicroscopeCampaign campaign = perfect_campaign();
  const Scenario& scenario = campaign.scenario;
  const auto study = study_plan(campaign);
  std::vector<int> orbits = study->scope().num_steps;
  for (const int num_orbits : {10, 25}) {
    orbits[6] = num_orbits;
    const double duration_s =
        num_orbits * scenario.orbit.period_s - scenario.estimation.transient_s;
    const Excitation& push = scenario.sessions[6].excitations[0];
    const std::complex<double> s(0.0, turn_rad * push.frequency_hz);
    const std::complex<double> loop = turn_rad * scenario.drag_free.bandwidth_hz / s *
                                      (1.0 + turn_rad * scenario.drag_free.integral_hz / s);
    const double amplitude = push.amplitude * std::abs(loop / (1.0 + loop));
    const double sigma =
        scenario.noise.linear_x.white_asd / amplitude / std::sqrt(2.0 * duration_s);
    const PlanBound bound = study->bound(orbits);
    EXPECT_NEAR(bound.standard_errors[index(Parameter::a_d12)] / sigma, 1.0, 1e-3);
  }
}

// Two objectives of three standard errors, 2Φ(−3), and all others far away.
TEST(PlanStudy, TellsTheChanceOfTheObjectives) {
  MicroscopeCampaign campaign = perfect_campaign();
  const auto nominal = study_plan(campaign);
  const PlanBound before = nominal->bound(nominal->scope().num_steps);
  for (std::size_t i = 0; i < num_parameters; ++i) {
    campaign.scenario.objectives[i] = (i < 2 ? 3.0 : 9.0) * before.standard_errors[i];
  }
  const auto study = study_plan(campaign);
  const PlanBound bound = study->bound(study->scope().num_steps);
  const double miss = 0.0026997960632601866;  // 2Φ(−3), [Wichura1988] or any table.
  EXPECT_NEAR(bound.misses[0], miss, 1e-9);
  EXPECT_LT(bound.misses[2], 1e-17);
  EXPECT_NEAR(bound.misses_any, miss + miss - miss * miss, 1e-9);
}

/// Both motions of the masses at once, and what else tells all parameters, in 16 orbits.
MicroscopeCampaign simultaneous_campaign() {
  MicroscopeCampaign campaign = test::coarse_campaign();
  const auto lasting_4 = [](const char* name, std::vector<Excitation> excitations,
                            DragFreeSource source) {
    Session session;
    session.name = name;
    session.target = SessionTarget::no_target;
    session.num_orbits = 4;
    session.drag_free = source;
    session.excitations = std::move(excitations);
    session.fit_lines = {{2.0}};
    return session;
  };
  const auto of = [](SessionTarget target) {
    for (const Session& session : hardy2013_sessions()) {
      if (session.target == target) return session.excitations.front();
    }
    return Excitation{};
  };
  using enum SessionTarget;
  Excitation z = of(a_c13), push_z = of(a_d13);
  z.frequency_hz = 0.0091237;
  push_z.frequency_hz = 1.36e-3;
  campaign.scenario.sessions = {
      lasting_4("yz_x", {of(a_c12), z, of(a_d11_prime)}, DragFreeSource::common),
      lasting_4("yz_yz", {of(a_c12), z, of(a_d12), push_z}, DragFreeSource::common),
      lasting_4("one", {of(k2_sensor_1), of(a_d11_prime), of(a_c11_delta_y)},
                DragFreeSource::sensor_2),
      lasting_4("two", {of(k2_sensor_2), of(a_d11_prime), of(a_c11_delta_y)},
                DragFreeSource::sensor_1)};
  campaign.scenario.estimation.method = EstimationMethod{2};
  return campaign;
}

/// Of the mean over the parameters of pull² in a run: two squares of normal variables with the
/// correlation ρ have the covariance 2ρ².
double variance_of_squares(const std::array<ParameterArray, num_parameters>& correlations) {
  double sum = 0.0;
  for (const ParameterArray& row : correlations) {
    for (const double rho : row) sum += 2.0 * rho * rho;
  }
  return sum / static_cast<double>(num_parameters * num_parameters);
}

// The estimator states the bound, and its errors are as large as it says: a standard error that is
// wrong by 10 % makes the mean square of errors 0.83 or 1.21.
TEST(PlanStudy, IsWhatTheEstimatorStates) {
  constexpr std::uint64_t num_runs = 16 * batch_lanes;
  MicroscopeCampaign campaign = simultaneous_campaign();
  campaign.seed = 61;
  test::fix(campaign, "offcentring_m.x", 1e-5);
  test::fix(campaign, "offcentring_m.y", -1.5e-5);
  test::fix(campaign, "offcentring_m.z", 0.8e-5);
  test::fix(campaign, "quadratic_factor_s2_m.sensor_1_x", 8000.0);
  test::fix(campaign, "quadratic_factor_s2_m.sensor_2_x", -3000.0);
  campaign.validate();
  const auto study = study_plan(campaign);
  const PlanBound bound = study->bound(study->scope().num_steps);
  const RunPlan plan(campaign);
  std::vector<double> means(num_parameters);
  double squares = 0.0, variance = 0.0, chi_squared = 0.0, freedom = 0.0;
  for (const RunRecord& record : test::recorded(plan, num_runs)) {
    const Estimation found = plan.estimation(record);
    EXPECT_TRUE(found.converged);
    for (std::size_t i = 0; i < num_parameters; ++i) {
      const double pull = (found.values[i] - record.truth[i]) / found.standard_errors[i];
      means[i] += found.standard_errors[i] / static_cast<double>(num_runs);
      squares += pull * pull / static_cast<double>(num_runs * num_parameters);
    }
    variance += variance_of_squares(found.correlations) / std::pow(num_runs, 2.0);
    for (const SessionFit& fit : found.session_fits) {
      chi_squared += fit.chi_squared;
      freedom += fit.degrees_of_freedom;
    }
  }
  for (std::size_t i = 0; i < num_parameters; ++i) {
    EXPECT_NEAR(means[i] / bound.standard_errors[i], 1.0, 0.03) << test::parameter_infos()[i].name;
  }
  EXPECT_NEAR(squares, 1.0, 4.0 * std::sqrt(variance));
  EXPECT_LT(4.0 * std::sqrt(variance), 0.17);
  EXPECT_NEAR(chi_squared / freedom, 1.0, 5.0 * std::sqrt(2.0 / freedom) + 0.04);
}

/// simultaneous_campaign() of one instrument without errors.
MicroscopeCampaign fixed_campaign() {
  MicroscopeCampaign campaign = simultaneous_campaign();
  campaign.dispersions = perfect_campaign().dispersions;
  return campaign;
}

/// The allocation of 18 orbits with the largest value, of all that there are.
std::vector<int> best_of_all(const std::function<double(const std::vector<int>&)>& value) {
  std::vector<int> best;
  for (int i = 2; i <= 12; ++i) {
    for (int j = 2; i + j <= 14; ++j) {
      for (int k = 2; i + j + k <= 16; ++k) {
        const std::vector<int> orbits{i, j, k, 18 - i - j - k};
        if (best.empty() || value(orbits) > value(best)) best = orbits;
      }
    }
  }
  return best;
}

// As o_i/σ_i → 0, log Π erf(o_i/(σ_i√2)) → Σ log(o_i/σ_i) + a constant. As it grows, the chance
// that one objective is missed becomes that of the smallest one: 1 − erf falls faster than any
// power.
TEST(PlanStudy, AllocatesWhereTheChanceRoundsToZeroOrOne) {
  MicroscopeCampaign campaign = fixed_campaign();
  const ParameterArray objectives = campaign.scenario.objectives;
  const auto study = study_plan(campaign);
  const auto errors = [&](const std::vector<int>& n) { return study->bound(n).standard_errors; };
  const auto little = [&](const std::vector<int>& n) {
    double sum = 0.0;
    for (const double error : errors(n)) sum -= std::log(error);
    return sum;
  };
  const auto much = [&](const std::vector<int>& n) {
    double least = 1e300;
    const std::vector<double> found = errors(n);
    for (std::size_t i = 0; i < num_parameters; ++i) {
      least = std::min(least, objectives[i] / found[i]);
    }
    return least;
  };
  const auto allocation = [&](double scale) {
    for (std::size_t i = 0; i < num_parameters; ++i) {
      campaign.scenario.objectives[i] = scale * objectives[i];
    }
    const auto scaled = study_plan(campaign);
    EXPECT_EQ(scaled->bound(std::vector<int>{5, 5, 4, 4}).misses_any, scale < 1.0 ? 1.0 : 0.0);
    return allocate(4, {.num_steps = 18, .minimum = 2},
                    [&](std::span<const int> n) { return scaled->merit(PlanGoal::objectives, n); });
  };
  EXPECT_EQ(allocation(1e-4), best_of_all(little));
  EXPECT_EQ(allocation(1e3), best_of_all(much));
}

// The squares' noise has the fourth power of the loops' noise. A record that is as long again has
// twice the signal; noise is watched only where nothing is shaken.
TEST(PlanStudy, SeesTheNoiseOfSquaresOfAllSessionsTogether) {
  constexpr std::size_t square_noise = 4;
  const auto of = [](double noise_scale, int num_repetitions, bool is_watched) {
    MicroscopeCampaign campaign = simultaneous_campaign();
    campaign.scenario.noise.scale = noise_scale;
    std::vector<Session>& sessions = campaign.scenario.sessions;
    const std::vector<Session> once = sessions;
    for (int i = 1; i < num_repetitions; ++i) {
      for (Session session : once) {
        session.name += "_again";
        sessions.push_back(session);
      }
    }
    if (is_watched) {
      Session quiet = once.front();
      quiet.name = "quiet";
      quiet.excitations.clear();
      sessions.push_back(quiet);
    }
    return RunPlan(campaign).simulate(RunIndex{0}, {}).health[square_noise];
  };
  EXPECT_EQ(of(5.0, 1, false), 0.0);
  const double once = of(5.0, 1, true);
  EXPECT_GT(once, 0.0);
  EXPECT_NEAR(of(10.0, 1, true) / once, 16.0, 3.0);
  EXPECT_NEAR(of(5.0, 2, true) / once, 0.5, 0.05);
}

// Against a periodogram of the squares themselves: of a scale that all their lines tell together,
// the noise leaves the relative power 2S/Σ T |A|². Some 600 bins, neighbours of which correlate,
// and 740 steps from block to block leave 6 % each.
TEST(PlanStudy, SeesTheNoiseOfSquaresThatAPeriodogramShows) {
  constexpr std::size_t square_noise = 4;
  MicroscopeCampaign campaign = simultaneous_campaign();
  campaign.scenario.simulation.sample_period_s = 0.25;
  campaign.scenario.noise.scale = 10.0;
  const Session shaken = campaign.scenario.sessions.front();
  const std::size_t quiet = campaign.scenario.sessions.size();
  campaign.scenario.sessions.push_back(shaken);
  campaign.scenario.sessions[quiet].name = "quiet";
  campaign.scenario.sessions[quiet].excitations.clear();
  campaign.scenario.sessions[quiet].num_orbits = 16;
  const RunPlan plan(campaign);
  std::array<std::vector<double>, 2> squares;
  const RunRecord record = plan.record(RunIndex{0}, {}, {}, [&](const ObservedSample& sample) {
    if (sample.session != quiet || sample.index < 0) return;
    const double common = sample.signals[index(Signal::common_x)];
    const double differential = sample.signals[index(Signal::differential_x)];
    squares[0].push_back((common + differential) * (common + differential));
    squares[1].push_back((common - differential) * (common - differential));
  });
  double largest = 0.0;
  for (std::size_t sensor = 0; sensor < squares.size(); ++sensor) {
    const Periodogram spectrum =
        hann_periodogram(squares[sensor], campaign.scenario.simulation.sample_period_s);
    const auto bin = [&](double hz) {
      return static_cast<std::ptrdiff_t>(hz * spectrum.duration_s);
    };
    const std::ptrdiff_t first = bin(1e-3), last = bin(7e-3);
    const double density =
        std::accumulate(spectrum.psd.begin() + first, spectrum.psd.begin() + last, 0.0) /
        static_cast<double>(last - first);
    double signal = 0.0;
    for (std::size_t i = 0; i < quiet; ++i) {
      const Session& session = campaign.scenario.sessions[i];
      const auto lines =
          estimation_method(campaign.scenario.estimation.method).needs(session).lines;
      for (std::size_t k = 0; k < lines.size(); ++k) {
        if (lines[k].signals != LineSignals::squares) continue;
        const auto amplitude = record.phasors[i].lines[k][num_line_bases + sensor];
        signal += fit_duration_s(campaign.scenario, session) * std::norm(amplitude);
      }
    }
    largest = std::max(largest, 2.0 * density / signal);
  }
  EXPECT_NEAR(plan.estimate(record).health[square_noise] / largest, 1.0, 0.25);
}

// A misalignment that is to be known to 1e-13 rad is moved by the square of any angle.
TEST(PlanStudy, NamesWhatLosesRunsBesideTheRange) {
  MicroscopeCampaign campaign = simultaneous_campaign();
  campaign.scenario.objectives[index(Parameter::a_c12)] = 1e-13;
  const auto study = study_plan(campaign);
  const PlanBound bound = study->bound(study->scope().num_steps);
  ASSERT_EQ(bound.losses.size(), 1U);
  EXPECT_EQ(bound.num_lost(), batch_lanes);
  EXPECT_EQ(bound.losses[0].cause, "attitude");
  EXPECT_EQ(bound.losses[0].detail, "may move the estimate of a_c12 beyond its objective");
}

/// The largest acceleration that a sensor measures in a run.
double largest_m_s2(const RunRecord& record) {
  return std::ranges::max(record.health, {}, &SessionHealth::acceleration_m_s2).acceleration_m_s2;
}

// A slow controller does not follow the pushes that the paper's does, and keeps sensors within a
// range that they leave with the paper's loops, or if biases drift: in runs, and so in probed ones.
TEST(PlanStudy, ProbesTheLoopsOfTheCampaign) {
  MicroscopeCampaign campaign = fixed_campaign();
  campaign.num_runs = 1;
  MicroscopeCampaign slow = campaign;
  slow.scenario.controllers.push_back({.loop = ControlLoop::drag_free,
                                       .axis = Axis::x,
                                       .gain = 1e-4,
                                       .zeros_rad_s = {},
                                       .poles_rad_s = {0.0}});
  const double nominal_m_s2 = largest_m_s2(RunPlan(campaign).record(RunIndex{0}, {}));
  const double slow_m_s2 = largest_m_s2(RunPlan(slow).record(RunIndex{0}, {}));
  ASSERT_GT(nominal_m_s2, 1.05 * slow_m_s2);
  MicroscopeCampaign drifting = slow;
  drifting.scenario.realism.emplace().bias_drift_m_s3 = {1e-11, 1e-11};
  for (MicroscopeCampaign* of : {&campaign, &slow, &drifting}) {
    of->scenario.sensor.range_m_s2 = std::sqrt(nominal_m_s2 * slow_m_s2);
    const auto study = study_plan(*of);
    const PlanBound bound = study->bound(study->scope().num_steps);
    const std::vector<PlanLoss>& losses = bound.losses;
    const Loss loss = RunPlan(*of).simulate(RunIndex{0}, {}).loss;
    const bool is_lost = loss.cause == static_cast<std::uint32_t>(LossCause::saturation);
    EXPECT_EQ(is_lost, of != &slow);
    // Noise takes some of the probed runs beyond it, and all where this run is.
    const auto saturation = std::ranges::find(losses, "saturation", &PlanLoss::cause);
    const std::size_t num_lost = saturation == losses.end() ? 0 : saturation->num_runs;
    EXPECT_EQ(num_lost == study->scope().num_probed, is_lost) << num_lost;
  }
}

/// fixed_campaign() with a test that turns at 0.04 rad/s, between its sessions.
MicroscopeCampaign tested_campaign() {
  MicroscopeCampaign campaign = fixed_campaign();
  Session test;
  test.name = "turning";
  test.target = SessionTarget::ep_test;
  test.num_orbits = 8;
  test.spin_rate_rad_s = 0.04;
  std::vector<Session>& sessions = campaign.scenario.sessions;
  sessions.insert(sessions.begin() + 2, test);
  return campaign;
}

// Of every |error| the mean is σ√(2/π). A test at f_EP = 6.5 mHz is left more of the drag than
// calibrations are, and the campaign file does not know how much.
TEST(PlanStudy, TakesTheLevelOfTheBudgetFromProbedTests) {
  MicroscopeCampaign campaign = tested_campaign();
  campaign.scenario.budget.test_spin_rate_rad_s = 0.04;
  const auto study = study_plan(campaign);
  const std::size_t level = budget_level(campaign.scenario);
  const double of_a_run = RunPlan(campaign).simulate(RunIndex{0}, {}).health[level];
  ASSERT_GT(of_a_run, 100.0 * campaign.scenario.budget.residual_m_s2);
  EXPECT_NEAR(study->scope().probed_level / of_a_run, 1.0, 0.03);
  const PlanBound bound = study->bound(study->scope().num_steps);
  std::vector<double> errors;
  for (const double sigma : bound.standard_errors) {
    errors.push_back(sigma * std::sqrt(2.0 / std::numbers::pi));
  }
  errors.resize(errors.size() + num_test_parameters);
  const ErrorBudget budget = campaign.error_budget().value();
  EXPECT_NEAR(*bound.mean_budget / budget.after(errors, study->scope().probed_level).total, 1.0,
              1e-12);
}

// No session tells what the loop leaves if each is shaken.
TEST(PlanStudy, AssumesTheLevelThatNoProbedRunTells) {
  EXPECT_EQ(study_plan(fixed_campaign())->scope().probed_level, 0.0);
}

// Ω²r = 4.8e-4 m/s² at 0.3 m makes 2 K2 Ω²r = 13 of the scale factor, which turns the loop's sign:
// in the test alone.
TEST(PlanStudy, ProbesTestsToo) {
  MicroscopeCampaign campaign = tested_campaign();
  campaign.num_runs = 1;
  for (const char* sensor : {"sensor_1_x", "sensor_2_x"}) {
    test::fix(campaign, std::string("quadratic_factor_s2_m.") + sensor, 14000.0);
  }
  const auto losses = [&] {
    const auto study = study_plan(campaign);
    return study->bound(study->scope().num_steps).losses;
  };
  EXPECT_TRUE(losses().empty());
  campaign.scenario.sensor.position_m[0] = 0.3;
  const std::vector<PlanLoss> found = losses();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].cause, "saturation");
  EXPECT_EQ(found[0].session, "turning");
  EXPECT_EQ(found[0].num_runs, batch_lanes);
  const Loss loss = RunPlan(campaign).simulate(RunIndex{0}, {}).loss;
  EXPECT_EQ(loss.session, static_cast<std::uint32_t>(SessionTarget::ep_test));
}

// Ten times the noise: in its square the line of K2d² is as small as the noise is large.
TEST(PlanStudy, HasTheWarningsOfItsProbedRuns) {
  MicroscopeCampaign campaign = simultaneous_campaign();
  campaign.scenario.simulation.sample_period_s = 0.25;
  Session quiet;
  quiet.name = "quiet";
  quiet.target = SessionTarget::no_target;
  quiet.num_orbits = 4;
  quiet.fit_lines = {{2.0}};
  campaign.scenario.sessions.push_back(quiet);
  const auto warnings = [&] {
    const auto study = study_plan(campaign);
    return study->bound(study->scope().num_steps).warnings;
  };
  EXPECT_EQ(warnings().num_runs, 0U);
  campaign.scenario.noise.scale = 10.0;
  const PlanWarnings found = warnings();
  EXPECT_EQ(found.effect, "square_noise");
  EXPECT_EQ(found.quantity, index(Parameter::k2d));
  EXPECT_GT(found.largest_part, warned_part);
}

TEST(PlanStudy, IsInfiniteForWhatNoSessionDetermines) {
  const auto study = study_plan(test::coarse_campaign());
  const PlanBound bound = study->bound(std::vector<int>(study->scope().num_steps.size(), 0));
  for (const double error : bound.standard_errors) EXPECT_TRUE(std::isinf(error));
  EXPECT_NEAR(bound.misses_any, 1.0, 1e-12);
}

// What is written is read again as the plan that it is of.
TEST(PlanStudy, WritesTheCampaignThatItsBoundIsOf) {
  MicroscopeCampaign campaign = test::coarse_campaign();
  campaign.scenario.estimation.transient_s = 3000.0;
  const auto study = study_plan(campaign);
  std::vector<int> orbits = study->scope().num_steps;
  orbits[3] = 37;
  const MicroscopeCampaign written = test::parse_campaign("written", study->campaign_file(orbits));
  EXPECT_EQ(estimation_method(written.scenario.estimation.method).name, "joint");
  EXPECT_EQ(written.num_runs, campaign.num_runs);
  const auto again = study_plan(written);
  EXPECT_EQ(again->scope().num_steps, orbits);
  EXPECT_EQ(again->bound(orbits).standard_errors, study->bound(orbits).standard_errors);
  orbits[3] = study->scope().num_steps_max;
  EXPECT_FALSE(study->campaign_file(orbits).empty());
  ++orbits[3];
  EXPECT_THROW((void)study->campaign_file(orbits), ConfigError);
  orbits[3] = 37;
  orbits[4] = 1;  // Less than twice the transient.
  EXPECT_THROW((void)study->campaign_file(orbits), ConfigError);
}

}  // namespace
}  // namespace proofmass
