// The joint estimation on simulated runs of the paper's sessions: what it finds without noise, and
// whether its standard errors are honest with it.

#include "core/microscope/campaign/shift_bounds.hpp"
#include "core/microscope/estimation/joint/joint.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/runs.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

struct Outcome {
  ParameterArray truth;
  Estimation found;

  [[nodiscard]] double error(std::size_t i) const { return found.values[i] - truth[i]; }
};

std::vector<Outcome> simulated(const MicroscopeCampaign& campaign, std::uint64_t num_runs) {
  const RunPlan plan(campaign, joint_method);
  std::vector<Outcome> runs;
  for (const RunRecord& record : test::recorded(plan, num_runs)) {
    runs.push_back({record.truth, plan.estimation(record)});
  }
  return runs;
}

/// What the sessions cannot tell of a parameter, at most. T_yy = 0 and T_zz = −T_xx at 2 f_orb, so
/// that all of η_cz (1e-4 rad) is in a_c12 and half of η_cy in a_c13; and so are the star tracker's
/// tilts β, up to 5e-5 rad, of which a_c11Δx gets β_z Δy − 2 β_y Δz and a_c11Δz 2 β_y Δx − β_x Δy.
/// The constant b is known to the read-out biases, δb = 1e-8 m/s²: κ to 2 K2d δb, and squares to
/// 4 K2_k δb of them.
double hidden_part(const ParameterArray& truth, Parameter parameter) {
  constexpr double coupling_rad = 1e-4, tilt_rad = 5e-5, bias_m_s2 = 1e-8;
  const auto size = [&](Parameter of) { return std::abs(truth[index(of)]); };
  using enum Parameter;
  const double kappa = 2.0 * size(k2d) * bias_m_s2;
  switch (parameter) {
    case a_c11_delta_x:
      return tilt_rad * (size(a_c11_delta_y) + 2.0 * size(a_c11_delta_z)) +
             kappa * size(a_c11_delta_x);
    case a_c11_delta_z:
      return tilt_rad * (2.0 * size(a_c11_delta_x) + size(a_c11_delta_y)) +
             kappa * size(a_c11_delta_z);
    case k2d:
      return 4.0 * bias_m_s2 * (size(k2d) * size(k2d) + size(k2c) * size(k2c));
    case a_c12:
      return coupling_rad + tilt_rad;
    case a_c13:
      return 0.5 * coupling_rad + tilt_rad;
    default:
      return 0.0;
  }
}

// The model leaves out a fiftieth of each objective at most.
TEST(JointCampaign, FindsTheTruthWithoutNoise) {
  MicroscopeCampaign campaign;
  campaign.seed = 40;
  campaign.scenario.noise.scale = 0.0;
  for (const Outcome& run : simulated(campaign, batch_lanes)) {
    EXPECT_TRUE(run.found.converged);
    for (std::size_t i = 0; i < num_parameters; ++i) {
      const double bound = campaign.scenario.objectives[i] / 50.0 +
                           hidden_part(run.truth, static_cast<Parameter>(i));
      EXPECT_LE(std::abs(run.error(i)), bound) << test::parameter_infos()[i].name;
    }
  }
}

// At 1e-6 m/s² the product of K2c and K2d makes 1.5 K2c K2d Γ² of a_d11', a hundred times its
// standard error, and σ of K2d is a hundredth of that at 2e-8 m/s².
TEST(JointCampaign, ErrsLessThanItsStandardErrorsUnderStrongPushesWithoutNoise) {
  MicroscopeCampaign campaign = test::coarse_campaign();
  campaign.seed = 46;
  campaign.scenario.noise.scale = 0.0;
  for (Session& session : campaign.scenario.sessions) {
    for (Excitation& excitation : session.excitations) {
      if (excitation.kind == ExcitationKind::drag_free) excitation.amplitude = 1e-6;
    }
  }
  ParameterArray squares{}, variances{};
  for (const Outcome& run : simulated(campaign, batch_lanes)) {
    for (std::size_t i = 0; i < num_parameters; ++i) {
      squares[i] += run.error(i) * run.error(i);
      variances[i] += run.found.standard_errors[i] * run.found.standard_errors[i];
    }
  }
  for (std::size_t i = 0; i < num_parameters; ++i) {
    EXPECT_LE(squares[i], variances[i]) << test::parameter_infos()[i].name;
  }
}

// A rotation at 2 f_TM − 2 f_orb makes a line at f_TM − 2 f_orb by Ω̇, of which Coriolis's
// acceleration leaves 2 %. With Ω̇ alone in the model, a_c12 would move by 6e-4 rad.
TEST(JointCampaign, IsNotMovedByARotationAtTwiceTheFrequencyOfAMass) {
  MicroscopeCampaign campaign;
  campaign.seed = 44;
  campaign.scenario.noise.scale = 0.0;
  Session& session = campaign.scenario.sessions[3];
  const double f_hz =
      2.0 * session.excitations[0].frequency_hz - 2.0 / campaign.scenario.orbit.period_s;
  session.excitations.push_back(
      {ExcitationKind::attitude, Axis::z, 1e-6, f_hz, MassMotion::opposition});
  const std::size_t a_c12 = index(Parameter::a_c12);
  for (const Outcome& run : simulated(campaign, batch_lanes)) {
    EXPECT_LE(std::abs(run.error(a_c12)), campaign.scenario.objectives[a_c12] / 50.0 +
                                              hidden_part(run.truth, Parameter::a_c12));
  }
}

// A mean of n squares of standard normal numbers scatters by √(2/n). Five of that for each
// parameter, in 48 draws, tell a standard error that is wrong by half; χ² of all sessions, 3000
// degrees of freedom, one that is wrong by a tenth, and that of a session, 300, by half. 4 % are
// left to the filters of the noise, which keep within 0.15 dB of the density that the weights are
// made of.
TEST(JointCampaign, HasHonestStandardErrors) {
  constexpr std::uint64_t num_runs = 48;
  MicroscopeCampaign campaign;
  campaign.seed = 41;
  const std::vector<Outcome> runs = simulated(campaign, num_runs);
  ASSERT_EQ(runs.size(), num_runs);
  const double deviation = std::sqrt(2.0 / static_cast<double>(num_runs));
  for (std::size_t i = 0; i < num_parameters; ++i) {
    double squares = 0.0, variance = 0.0, errors = 0.0;
    for (const Outcome& run : runs) {
      squares += run.error(i) * run.error(i) / static_cast<double>(num_runs);
      errors += run.error(i) / static_cast<double>(num_runs);
      variance += run.found.standard_errors[i] * run.found.standard_errors[i] /
                  static_cast<double>(num_runs);
      EXPECT_NEAR(run.found.correlations[i][i], 1.0, 1e-12);
    }
    const char* const name = test::parameter_infos()[i].name.data();
    EXPECT_NEAR(squares / variance, 1.0, 5.0 * deviation) << name;
    EXPECT_GT(squares / variance, 0.4) << name;  // χ² of 48 is below that in 1 of 1e5.
    EXPECT_LE(std::abs(errors), 5.0 * std::sqrt(variance / static_cast<double>(num_runs))) << name;
  }
  std::vector<SessionFit> sessions(campaign.scenario.sessions.size());
  SessionFit all;
  for (const Outcome& run : runs) {
    EXPECT_TRUE(run.found.converged);
    for (std::size_t i = 0; i < sessions.size(); ++i) {
      for (SessionFit* const sum : {&sessions[i], &all}) {
        sum->chi_squared += run.found.session_fits[i].chi_squared;
        sum->degrees_of_freedom += run.found.session_fits[i].degrees_of_freedom;
      }
    }
  }
  sessions.push_back(all);
  for (const SessionFit& fit : sessions) {
    const double freedom = fit.degrees_of_freedom;
    EXPECT_NEAR(fit.chi_squared / freedom, 1.0, 5.0 * std::sqrt(2.0 / freedom) + 0.04) << freedom;
  }
}

Dispersion normal_law(Law law, double mean, double deviation) {
  Dispersion normal;
  normal.law = law;
  normal.mean = mean;
  normal.standard_deviation = deviation;
  return normal;
}

// Nuisances as large as what noise makes of the parameters, by laws that are neither uniform nor
// normal nor independent. Of a_c12 no session tells η_cz: half the sum of two values with the
// correlation −0.9, a twentieth of the variance of one of them; taken for independent, its error
// would be three times too large. Of a_c13 none tells half of η_cy: one value, of which one in ten
// is far from the others, and its copy; taken for independent, it would have half of its variance.
// Mean squares keep within five of their own standard errors.
TEST(JointCampaign, HasHonestStandardErrorsUnderEveryLaw) {
  constexpr std::uint64_t num_runs = 128;
  MicroscopeCampaign campaign = test::coarse_campaign();
  campaign.seed = 45;
  campaign.scenario.acceptance = {.a_d11_max = 0.1, .a_d1j_max_rad = 0.1, .a_c1j_max_rad = 0.1};
  test::law_of(campaign, "coupling_rad.sensor_1_z") = normal_law(Law::normal, 0.0, 3e-3);
  Dispersion& correlated = test::law_of(campaign, "coupling_rad.sensor_2_z");
  correlated = normal_law(Law::correlated, 2e-3, 3e-3);
  correlated.with = {"coupling_rad.sensor_1_z"};
  correlated.correlations = {-0.9};
  Dispersion& discrete = test::law_of(campaign, "coupling_rad.sensor_1_y");
  discrete.law = Law::discrete;
  discrete.values = {0.0, 5e-3};
  discrete.probabilities = {0.9, 0.1};
  Dispersion& derived = test::law_of(campaign, "coupling_rad.sensor_2_y");
  derived.law = Law::derived;
  derived.expression = "coupling_rad.sensor_1_y";
  Dispersion& truncated = test::law_of(campaign, "read_out_bias_m_s2.sensor_1_x");
  truncated = normal_law(Law::truncated, 0.0, 1e-8);
  truncated.minimum = 3e-8;
  truncated.maximum = 6e-8;
  campaign.validate();

  const std::vector<Outcome> runs = simulated(campaign, num_runs);
  for (std::size_t i = 0; i < num_parameters; ++i) {
    double squares = 0.0, fourths = 0.0, variance = 0.0, errors = 0.0;
    for (const Outcome& run : runs) {
      const double square = run.error(i) * run.error(i);
      squares += square / num_runs;
      fourths += square * square / num_runs;
      errors += run.error(i) / num_runs;
      variance += run.found.standard_errors[i] * run.found.standard_errors[i] / num_runs;
    }
    const char* const name = test::parameter_infos()[i].name.data();
    EXPECT_NEAR(squares, variance, 5.0 * std::sqrt((fourths - squares * squares) / num_runs))
        << name;
    EXPECT_NEAR(errors, 0.0, 5.0 * std::sqrt(squares / num_runs)) << name;
  }
}

// A disturbance of ½ K2d R² at 2 f_orb of every session is what a residual R/2 at f_EP is taken to
// make. The bound is rigorous, and allows for two lines a session and white noise alone.
TEST(JointCampaign, IsMovedByADisturbanceLessFarThanItsBound) {
  MicroscopeCampaign campaign;
  campaign.seed = 43;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 4;
  const RunPlan plan(campaign, joint_method);
  RunRecord record = plan.record(RunIndex{0}, {});
  const Estimation before = plan.estimation(record);
  const double residual_m_s2 = 1e-10;
  const std::size_t delta = index(Parameter::a_c11_delta_x), k2d = index(Parameter::k2d);
  const double line_m_s2 = 0.5 * std::abs(record.truth[k2d]) * 4.0 * residual_m_s2 * residual_m_s2;
  for (SessionPhasors& session : record.phasors) session.lines[0][0] += line_m_s2;
  const double moved = std::abs(plan.estimation(record).values[delta] - before.values[delta]);
  double bound = 0.0;
  for (const Shift& shift :
       ShiftBounds(campaign.scenario, campaign.dispersions)
           .of({.residual_m_s2 = residual_m_s2}, record.truth, before.standard_errors)) {
    if (shift.effect == Effect::residual && index(shift.parameter) == delta) {
      bound = shift.part * campaign.scenario.objectives[delta];
    }
  }
  EXPECT_LT(moved, bound);
  EXPECT_GT(moved, 0.1 * bound);
}

// Every session for two orbits, with a record that has all kinds of lines.
TEST(JointCampaign, HasTheBitsOfARunAloneInABatch) {
  MicroscopeCampaign campaign;
  campaign.seed = 42;
  campaign.scenario.simulation.settling_s = 100.0;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 2;
  campaign.scenario.sessions[3].excitations.push_back(
      {ExcitationKind::test_mass, Axis::z, 1e-5, 0.0091237, MassMotion::opposition});
  const RunPlan plan(campaign, joint_method);
  const Estimation alone = plan.estimation(plan.record(RunIndex{1}, {}));
  for (const InstructionSet set : available_instruction_sets()) {
    if (set == InstructionSet::scalar) continue;
    for (const std::uint64_t size : {2U, 16U}) {
      const auto requests = test::requests_from(0, size);
      const Estimation found = plan.estimation(plan.record_batch(requests, set)[1]);
      for (std::size_t i = 0; i < num_parameters; ++i) {
        EXPECT_EQ(std::bit_cast<std::uint64_t>(found.values[i]),
                  std::bit_cast<std::uint64_t>(alone.values[i]));
        EXPECT_EQ(std::bit_cast<std::uint64_t>(found.standard_errors[i]),
                  std::bit_cast<std::uint64_t>(alone.standard_errors[i]));
      }
    }
  }
}

}  // namespace
}  // namespace proofmass
