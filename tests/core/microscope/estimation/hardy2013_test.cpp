#include "core/microscope/estimation/hardy2013/hardy2013.hpp"

#include "core/error.hpp"
#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/random/stream.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/runs.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

using Complex = std::complex<double>;

/// Of the paper: each has a target of its own.
constexpr std::size_t num_sessions = 11;

/// Ten values of natural size, and the objectives of the paper.
ParameterArray example_truth() {
  return {12e-6, -7e-6, 15e-6, 1.1e-3, -2.3e-3, 6e-3, -1.2e-3, 0.8e-3, 5000.0, -9000.0};
}

double at(const ParameterArray& values, Parameter parameter) { return values[index(parameter)]; }

/// Arbitrary phasors of natural size for every signal except the differential measurement.
SessionPhasors random_phasors(std::uint32_t session, std::size_t num_lines) {
  SessionPhasors phasors;
  phasors.num_fit_lines = num_lines;
  for (std::size_t s = 1; s < num_signals; ++s) {
    for (std::size_t line = 0; line < num_lines; ++line) {
      const auto number = [&](std::uint32_t part) {
        return 2.0 * uniform(philox({session, static_cast<std::uint32_t>(s),
                                     static_cast<std::uint32_t>(line), part},
                                    1)) -
               1.0;
      };
      const double size = s <= 3 ? 1e-10 : (s == index(Signal::product) ? 1e-16 : 1e-8);
      phasors.amplitude[s][line] = size * Complex(number(0), number(1));
    }
  }
  return phasors;
}

/// Γ_mes,dx at first order in the instrument's errors: a_d Γ_mes,c + ½[T − In]_xj a_c11Δ_j.
Complex linear_model(const SessionPhasors& phasors, std::size_t line, const ParameterArray& truth) {
  const auto signal = [&](Signal s) { return phasors.amplitude[index(s)][line]; };
  return at(truth, Parameter::a_d11_prime) * signal(Signal::common_x) +
         at(truth, Parameter::a_d12) * signal(Signal::common_y) +
         at(truth, Parameter::a_d13) * signal(Signal::common_z) +
         0.5 * (at(truth, Parameter::a_c11_delta_x) * signal(Signal::gradient_xx) +
                at(truth, Parameter::a_c11_delta_y) * signal(Signal::gradient_xy) +
                at(truth, Parameter::a_c11_delta_z) * signal(Signal::gradient_xz));
}

/// ½ (a_c12 [T − In]_yj + a_c13 [T − In]_zj) Δ_j.
Complex product_model(const SessionPhasors& phasors, std::size_t line,
                      const ParameterArray& truth) {
  const auto signal = [&](Signal s) { return phasors.amplitude[index(s)][line]; };
  const double x = at(truth, Parameter::a_c11_delta_x);
  const double y = at(truth, Parameter::a_c11_delta_y);
  const double z = at(truth, Parameter::a_c11_delta_z);
  return 0.5 * at(truth, Parameter::a_c12) *
             (x * signal(Signal::gradient_yx) + y * signal(Signal::gradient_yy) +
              z * signal(Signal::gradient_yz)) +
         0.5 * at(truth, Parameter::a_c13) *
             (x * signal(Signal::gradient_zx) + y * signal(Signal::gradient_zy) +
              z * signal(Signal::gradient_zz));
}

/// What each session makes large.
constexpr std::array<Signal, num_sessions> own_signals{
    Signal::gradient_xx, Signal::gradient_xz, Signal::gradient_xy, Signal::product,
    Signal::product,     Signal::common_x,    Signal::common_y,    Signal::common_z,
    Signal::product,     Signal::product,     Signal::product};

/// Γ_mes,dx per unit of that signal.
double own_factor(SessionTarget target, const ParameterArray& truth) {
  const double k2c = at(truth, Parameter::k2c);
  const std::array<double, num_sessions> factors{0.5 * at(truth, Parameter::a_c11_delta_x),
                                                 0.5 * at(truth, Parameter::a_c11_delta_z),
                                                 0.5 * at(truth, Parameter::a_c11_delta_y),
                                                 at(truth, Parameter::a_c12),
                                                 at(truth, Parameter::a_c13),
                                                 at(truth, Parameter::a_d11_prime),
                                                 at(truth, Parameter::a_d12),
                                                 at(truth, Parameter::a_d13),
                                                 at(truth, Parameter::k2d),
                                                 0.5 * k2c,
                                                 -0.5 * k2c};
  return factors[index(target)];
}

/// What a record holds if Γ_mes,dx obeys the model with `truth`; `slopes` as the K2 sessions show
/// them.
struct ModelRecord {
  ParameterArray truth = example_truth();
  bool with_products = false;
  double k2d_slope = 0.0;
  std::array<double, 2> k2_slopes{};

  [[nodiscard]] RunPhasors make() const {
    RunPhasors record(num_sessions);
    for (std::size_t i = 0; i < num_sessions; ++i) {
      const auto target = static_cast<SessionTarget>(i + 1);
      const bool sidebands = target == SessionTarget::a_c12 || target == SessionTarget::a_c13;
      SessionPhasors phasors = random_phasors(static_cast<std::uint32_t>(i), sidebands ? 2 : 1);
      dominate(target, phasors);
      for (std::size_t line = 0; line < phasors.num_fit_lines; ++line) {
        Complex& differential = phasors.amplitude[index(Signal::differential_x)][line];
        const Complex regressor = phasors.amplitude[index(Signal::product)][line];
        differential = linear_model(phasors, line, truth);
        if (with_products && i < 3) differential += product_model(phasors, line, truth);
        if (target == SessionTarget::a_c12) differential += at(truth, Parameter::a_c12) * regressor;
        if (target == SessionTarget::a_c13) differential += at(truth, Parameter::a_c13) * regressor;
        if (target == SessionTarget::k2d) differential += k2d_slope * regressor;
        if (target == SessionTarget::k2_sensor_1) differential += 0.5 * k2_slopes[0] * regressor;
        if (target == SessionTarget::k2_sensor_2) differential -= 0.5 * k2_slopes[1] * regressor;
      }
      record[i] = phasors;
    }
    return record;
  }

  /// Each session makes its own signal a hundred times larger: that is what it is for.
  static void dominate(SessionTarget target, SessionPhasors& phasors) {
    for (Complex& amplitude : phasors.amplitude[index(own_signals[index(target)])])
      amplitude *= 100.0;
    if (own_signals[index(target)] != Signal::product) return;
    // The gradients of these sessions lie elsewhere in frequency.
    for (std::size_t s = 1; s < num_signals; ++s) {
      if (s == index(Signal::product)) continue;
      for (Complex& amplitude : phasors.amplitude[s]) amplitude *= 1e-3;
    }
  }
};

EstimationConfig precise(Correction correction) {
  EstimationConfig config;
  config.correction = correction;
  config.convergence = 1e-12;
  config.num_rounds_max = 200;
  return config;
}

Estimation calibrate(const RunPhasors& record, const EstimationConfig& config,
                     const Scenario& scenario) {
  return estimate_hardy2013(record, {.sessions = scenario.sessions,
                                     .config = config,
                                     .objectives = scenario.objectives,
                                     .noise = scenario.noise,
                                     .attitude = scenario.attitude,
                                     .laws = drawn_moments(nominal_dispersions()),
                                     .orbit_period_s = scenario.orbit.period_s,
                                     .sample_period_s = scenario.simulation.sample_period_s});
}

/// The paper's sessions are in the order of their targets, as ModelRecord makes its records.
Estimation calibrate(const RunPhasors& record, const EstimationConfig& config) {
  return calibrate(record, config, Scenario());
}

const ParameterArray& objectives() {
  static const ParameterArray values = Scenario().objectives;
  return values;
}

void expect_estimates(const Estimation& result, const ParameterArray& truth) {
  EXPECT_TRUE(result.converged);
  for (const test::ParameterInfo& info : test::parameter_infos()) {
    EXPECT_NEAR(result.values[index(info.parameter)], truth[index(info.parameter)],
                1e-9 * objectives()[index(info.parameter)])
        << info.name;
  }
}

// The iteration's fixed point is the truth where the measurement obeys the first-order model.
TEST(EstimateHardy2013, FirstOrderInvertsTheFirstOrderModel) {
  ModelRecord model;
  model.k2d_slope = at(model.truth, Parameter::k2d);
  const double k2c = at(model.truth, Parameter::k2c);
  model.k2_slopes = {k2c + 700.0, k2c - 700.0};
  expect_estimates(calibrate(model.make(), precise(Correction::first_order)), model.truth);
}

// Second order: products of misalignment and off-centring in the three Δ sessions; the K2d slope is
// (K2d − a K2c)/K1c²; the slopes of the two sensors are (1 ∓ a)/(1 ± a)² of K2k/K1c².
TEST(EstimateHardy2013, SecondOrderInvertsTheModelWithProducts) {
  ModelRecord model;
  model.with_products = true;
  const double a = at(model.truth, Parameter::a_d11_prime);
  const double k2d = at(model.truth, Parameter::k2d);
  const double k2c = at(model.truth, Parameter::k2c);
  model.k2d_slope = k2d - a * k2c;
  const double k21 = k2c + k2d;
  const double k22 = k2c - k2d;
  model.k2_slopes = {k21 * (1.0 - a) / ((1.0 + a) * (1.0 + a)),
                     k22 * (1.0 + a) / ((1.0 - a) * (1.0 - a))};
  const RunPhasors record = model.make();
  expect_estimates(calibrate(record, precise(Correction::second_order)), model.truth);
  // First order leaves those terms: a K2c/K1c² is 54 s²/m here.
  const Estimation first = calibrate(record, precise(Correction::first_order));
  EXPECT_NEAR(first.values[index(Parameter::k2d)] - k2d, -a * k2c, 1e-6);
}

/// What Γ_calib,2 takes off 2Γ_mes,dx for Δx as printed.
Complex printed_terms(const SessionPhasors& phasors, const ParameterArray& estimate) {
  const auto signal = [&](Signal s) { return phasors.amplitude[index(s)][0]; };
  return at(estimate, Parameter::a_c13) * signal(Signal::gradient_zz) *
             at(estimate, Parameter::a_c11_delta_z) +
         2.0 * at(estimate, Parameter::a_d11_prime) * signal(Signal::common_x) +
         2.0 * at(estimate, Parameter::a_d12) * signal(Signal::common_y) +
         2.0 * at(estimate, Parameter::a_d13) * signal(Signal::common_z);
}

/// The part of a phasor in phase with another, as a multiple of it.
double in_phase(Complex signal, Complex regressor) {
  return (signal * std::conj(regressor)).real() / std::norm(regressor);
}

// [Hardy2013] 5.2 to the letter: Γ_calib,2 / T̂_xx is the estimate, with the other estimates in it.
TEST(EstimateHardy2013, EstimatesDeltaXFromThePrintedEquation) {
  const RunPhasors record = ModelRecord{.with_products = true}.make();
  const Estimation result = calibrate(record, precise(Correction::hardy2013));
  ASSERT_TRUE(result.converged);
  const SessionPhasors& session = record[index(SessionTarget::a_c11_delta_x)];
  // The paper separates Δx from Δz by phase, here both have both phases: the other is taken off.
  const Complex other_phase = at(result.values, Parameter::a_c11_delta_z) *
                                  session.amplitude[index(Signal::gradient_xz)][0] +
                              at(result.values, Parameter::a_c11_delta_y) *
                                  session.amplitude[index(Signal::gradient_xy)][0];
  const Complex calibrated = 2.0 * session.amplitude[index(Signal::differential_x)][0] -
                             printed_terms(session, result.values) - other_phase;
  const double expected = in_phase(calibrated, session.amplitude[index(Signal::gradient_xx)][0]);
  EXPECT_NEAR(at(result.values, Parameter::a_c11_delta_x), expected, 1e-9 * objectives()[0]);
}

/// A signal that the Δ session of `target` may hold, and the parameters that multiply it.
struct SessionTerm {
  SessionTarget target;
  Signal signal;
  double factor;
  Parameter first;
  std::optional<Parameter> second;  ///< None: the term has one parameter.
  bool is_subtracted;
};

/// The signal that a session is fitted against, and what that yields, for the three Δ sessions.
std::pair<Signal, Parameter> own_term(SessionTarget target) {
  if (target == SessionTarget::a_c11_delta_x)
    return {Signal::gradient_xx, Parameter::a_c11_delta_x};
  if (target == SessionTarget::a_c11_delta_z)
    return {Signal::gradient_xz, Parameter::a_c11_delta_z};
  return {Signal::gradient_xy, Parameter::a_c11_delta_y};
}

/// A record in which each session has no signal but the one that it is fitted against.
RunPhasors lone_terms(const ParameterArray& truth) {
  ModelRecord model;
  model.truth = truth;
  model.k2d_slope = at(truth, Parameter::k2d);
  model.k2_slopes = {at(truth, Parameter::k2c), at(truth, Parameter::k2c)};
  RunPhasors record = model.make();
  for (std::size_t i = 0; i < num_sessions; ++i) {
    const Signal own = own_signals[i];
    for (std::size_t line = 0; line < record[i].num_fit_lines; ++line) {
      const Complex regressor = record[i].amplitude[index(own)][line];
      for (auto& signal : record[i].amplitude) signal[line] = 0.0;
      record[i].amplitude[index(own)][line] = regressor;
      record[i].amplitude[0][line] =
          own_factor(static_cast<SessionTarget>(i + 1), truth) * regressor;
    }
  }
  return record;
}

class TermOfHardy2013 : public testing::TestWithParam<SessionTerm> {};

// Every session holds its own term alone, so that its estimate is exact, and this one a second
// term: that moves the estimate unless the correction takes it off again.
TEST_P(TermOfHardy2013, IsSubtractedIfListedAndOnlyThen) {
  const SessionTerm& term = GetParam();
  const ParameterArray truth = example_truth();
  RunPhasors record = lone_terms(truth);
  const auto& [own, parameter] = own_term(term.target);
  SessionPhasors& session = record[index(term.target)];
  const Complex regressor = session.amplitude[index(own)][0];
  const Complex other = Complex(0.6, -0.3) * regressor;
  session.amplitude[index(term.signal)][0] = other;
  const double size =
      term.factor * at(truth, term.first) * (term.second ? at(truth, *term.second) : 1.0);
  session.amplitude[0][0] += size * other;
  const Estimation result = calibrate(record, precise(Correction::hardy2013));
  const double left = term.is_subtracted ? 0.0 : 2.0 * size * 0.6;
  EXPECT_NEAR(at(result.values, parameter) - at(truth, parameter), left,
              1e-6 * std::abs(2.0 * size));
}

INSTANTIATE_TEST_SUITE_P(
    OfEachDeltaSession, TermOfHardy2013, testing::ValuesIn([] {
      std::vector<SessionTerm> terms;
      for (const auto target : {SessionTarget::a_c11_delta_x, SessionTarget::a_c11_delta_z,
                                SessionTarget::a_c11_delta_y}) {
        terms.push_back({target, Signal::common_x, 1.0, Parameter::a_d11_prime, {}, true});
        terms.push_back({target, Signal::common_y, 1.0, Parameter::a_d12, {}, true});
        terms.push_back({target, Signal::common_z, 1.0, Parameter::a_d13, {}, true});
      }
      const auto product = [&](SessionTarget target, Signal signal, Parameter misalignment,
                               Parameter offcentring, bool is_subtracted) {
        terms.push_back({target, signal, 0.5, misalignment, offcentring, is_subtracted});
      };
      product(SessionTarget::a_c11_delta_x, Signal::gradient_zz, Parameter::a_c13,
              Parameter::a_c11_delta_z, true);
      product(SessionTarget::a_c11_delta_x, Signal::gradient_zx, Parameter::a_c13,
              Parameter::a_c11_delta_x, false);
      product(SessionTarget::a_c11_delta_x, Signal::gradient_yy, Parameter::a_c12,
              Parameter::a_c11_delta_y, false);
      product(SessionTarget::a_c11_delta_z, Signal::gradient_zx, Parameter::a_c13,
              Parameter::a_c11_delta_x, true);
      product(SessionTarget::a_c11_delta_z, Signal::gradient_zz, Parameter::a_c13,
              Parameter::a_c11_delta_z, false);
      product(SessionTarget::a_c11_delta_y, Signal::gradient_yx, Parameter::a_c12,
              Parameter::a_c11_delta_x, true);
      product(SessionTarget::a_c11_delta_y, Signal::gradient_zx, Parameter::a_c13,
              Parameter::a_c11_delta_x, false);
      terms.push_back({SessionTarget::a_c11_delta_x,
                       Signal::gradient_xz,
                       0.5,
                       Parameter::a_c11_delta_z,
                       {},
                       true});
      return terms;
    }()));

// Only the part of the signal in phase with the regressor counts.
TEST(EstimateHardy2013, IgnoresWhatIsInQuadratureWithTheRegressor) {
  ModelRecord model;
  RunPhasors record = model.make();
  SessionPhasors& session = record[index(SessionTarget::a_d12)];
  session.amplitude[index(Signal::differential_x)][0] +=
      Complex(0.0, 0.3) * session.amplitude[index(Signal::common_y)][0];
  const Estimation result = calibrate(record, precise(Correction::first_order));
  EXPECT_NEAR(result.values[index(Parameter::a_d12)], at(model.truth, Parameter::a_d12), 1e-12);
}

/// Least squares over the samples of two records of 10 and 30 orbits counts the second three times.
TEST(EstimateHardy2013, WeightsTheSessionsOfATargetByTheirLengths) {
  const ParameterArray truth = example_truth();
  RunPhasors record = lone_terms(truth);
  Scenario scenario;
  scenario.estimation = precise(Correction::first_order);
  Session second = scenario.sessions[index(SessionTarget::a_d12)];
  second.name = "second";
  second.num_orbits = 30;
  scenario.sessions.push_back(second);
  record.push_back(record[index(SessionTarget::a_d12)]);
  // The second record has half of the regressor and a slope that is larger by 1e-5.
  const double slope = at(truth, Parameter::a_d12);
  Complex& regressor = record.back().amplitude[index(Signal::common_y)][0];
  regressor *= 0.5;
  record.back().amplitude[index(Signal::differential_x)][0] = (slope + 1e-5) * regressor;
  const Estimation result = calibrate(record, scenario.estimation, scenario);
  EXPECT_TRUE(result.converged);
  const double share = 3.0 * 0.25 / (1.0 + 3.0 * 0.25);
  EXPECT_NEAR(at(result.values, Parameter::a_d12), slope + share * 1e-5, 1e-12);
}

TEST(EstimateHardy2013, CountsItsRounds) {
  const RunPhasors record = ModelRecord{}.make();
  EstimationConfig config;
  config.num_rounds_max = 1;
  const Estimation one = calibrate(record, config);
  EXPECT_FALSE(one.converged);
  EXPECT_EQ(one.num_rounds, 1U);
  config.num_rounds_max = 50;
  const Estimation many = calibrate(record, config);
  EXPECT_TRUE(many.converged);
  EXPECT_GT(many.num_rounds, 1U);
  EXPECT_LT(many.num_rounds, 50U);
}

TEST(CheckHardy2013, WantsASessionForEveryTarget) {
  std::vector<Session> sessions = hardy2013_sessions();
  EXPECT_NO_THROW(check_hardy2013(sessions));
  sessions.push_back(sessions[3]);
  EXPECT_NO_THROW(check_hardy2013(sessions));
  sessions.back().target = SessionTarget::no_target;
  EXPECT_NO_THROW(check_hardy2013(sessions));
  sessions.pop_back();
  sessions.erase(sessions.begin() + 3);
  EXPECT_EQ(test::message_of<ConfigError>([&] { check_hardy2013(sessions); }),
            "session = 10 sessions (none has the target a_c12)");
}

TEST(EstimateHardy2013, NeverConvergesOnNumbersThatAreNotFinite) {
  RunPhasors record = ModelRecord{}.make();
  record[0].amplitude[0][0] = std::numeric_limits<double>::quiet_NaN();
  const Estimation result = calibrate(record, EstimationConfig{});
  EXPECT_FALSE(result.converged);
  EXPECT_FALSE(std::isfinite(result.values[0]));
}

// A slow loop leaves 2e-8 m/s² at f_EP, and noise moves a_d11' by 1e-6 in one orbit: 4e-15 of δ,
// beside 2.4e-15 by the noise of the test. Instruments are perfect: all errors are those of noise.
// Those of a_c11Δ have, besides their own, a_d11' times what the slow loop leaves, which is left
// out. The deviation of the mean square of error/σ is √(2/208).
TEST(EstimateHardy2013, GivesItsErrorToTheStandardErrorOfATest) {
  constexpr std::uint64_t num_runs = 208;
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.scenario.simulation = test::coarse_campaign().scenario.simulation;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 1;
  Session& test = campaign.scenario.sessions.emplace_back();
  test.name = "ep";
  test.target = SessionTarget::ep_test;
  test.num_orbits = 2;
  test.spin_rate_rad_s = 35.0 * std::numbers::pi / campaign.scenario.orbit.period_s;
  campaign.scenario.drag_free.bandwidth_hz = 3e-3;
  campaign.scenario.drag_free.integral_hz = 3e-4;
  campaign.scenario.environment.scale = 3.0;
  campaign.dispersions = test::perfect_laws();
  const RunPlan plan(campaign);
  std::array<double, num_parameters> ratios{};
  double squares = 0.0, variances = 0.0;
  for (const RunRecord& record : test::recorded(plan, num_runs)) {
    const Estimation found = plan.estimation(record);
    for (std::size_t i = 0; i < num_parameters; ++i) {
      const double ratio = (found.values[i] - record.truth[i]) / found.standard_errors[i];
      ratios[i] += ratio * ratio / num_runs;
    }
    const RunResult result = plan.estimate(record);
    ASSERT_EQ(result.standard_error.size(), 1U);
    squares += result.error(num_parameters) * result.error(num_parameters);
    variances += result.standard_error[0] * result.standard_error[0];
  }
  const double tolerance = 3.5 * std::sqrt(2.0 / num_runs);
  for (std::size_t i = index(Parameter::a_c12); i < num_parameters; ++i) {
    EXPECT_NEAR(ratios[i], 1.0, tolerance) << i;
  }
  EXPECT_NEAR(squares / variances, 1.0, tolerance);
}

}  // namespace
}  // namespace proofmass
