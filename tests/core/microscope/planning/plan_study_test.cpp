// The bound of a plan against closed forms, and against the standard errors and the errors of
// simulated runs.

#include "core/microscope/planning/plan_study.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <string_view>
#include <vector>

#include "core/error.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/estimation/joint/joint.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass {
namespace {

constexpr double turn_rad = 2.0 * std::numbers::pi;

/// An instrument without errors, whose sensors have white noise.
MicroscopeCampaign perfect_campaign() {
  MicroscopeCampaign campaign;
  for (Dispersion& dispersion : campaign.dispersions) {
    dispersion = {.law = Law::fixed, .file = {}, .column = {}};
  }
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
  std::vector<int> orbits = study->num_steps();
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
  const PlanBound before = study_plan(campaign)->bound(study_plan(campaign)->num_steps());
  for (std::size_t i = 0; i < num_parameters; ++i) {
    campaign.scenario.objectives[i] = (i < 2 ? 3.0 : 9.0) * before.standard_errors[i];
  }
  const auto study = study_plan(campaign);
  const PlanBound bound = study->bound(study->num_steps());
  const double miss = 0.0026997960632601866;  // 2Φ(−3), [Wichura1988] or any table.
  EXPECT_NEAR(bound.misses[0], miss, 1e-9);
  EXPECT_LT(bound.misses[2], 1e-17);
  EXPECT_NEAR(bound.misses_any, miss + miss - miss * miss, 1e-9);
}

/// Both motions of the masses at once, and what else tells all parameters, in 16 orbits.
MicroscopeCampaign simultaneous_campaign() {
  MicroscopeCampaign campaign;
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

/// Fixes what makes standard errors differ from one instrument to another.
void fix(MicroscopeCampaign& campaign, std::string_view name, double value) {
  const auto found = std::ranges::find(drawn_names(), name);
  campaign.dispersions[static_cast<std::size_t>(found - drawn_names().begin())] = {
      .law = Law::fixed, .value = value, .file = {}, .column = {}};
}

// The estimator states the bound. Its errors are as large as it says: a mean of 160 squares, not
// all of them independent, scatters by a tenth.
TEST(PlanStudy, IsWhatTheEstimatorStates) {
  MicroscopeCampaign campaign = simultaneous_campaign();
  campaign.seed = 61;
  fix(campaign, "offcentring_m.x", 1e-5);
  fix(campaign, "offcentring_m.y", -1.5e-5);
  fix(campaign, "offcentring_m.z", 0.8e-5);
  fix(campaign, "quadratic_factor_s2_m.sensor_1_x", 8000.0);
  fix(campaign, "quadratic_factor_s2_m.sensor_2_x", -3000.0);
  campaign.validate();
  const auto study = study_plan(campaign);
  const PlanBound bound = study->bound(study->num_steps());
  const RunPlan plan(campaign);
  std::vector<RunRequest> requests;
  for (std::uint64_t i = 0; i < batch_lanes; ++i) requests.push_back({RunIndex{i}, {}});
  std::vector<double> means(num_parameters);
  double squares = 0.0, chi_squared = 0.0, freedom = 0.0;
  for (const RunRecord& record : plan.record_batch(requests, best_instruction_set())) {
    const Estimation found = plan.estimation(record);
    EXPECT_TRUE(found.converged);
    for (std::size_t i = 0; i < num_parameters; ++i) {
      const double pull = (found.values[i] - record.truth[i]) / found.standard_errors[i];
      means[i] += found.standard_errors[i] / static_cast<double>(batch_lanes);
      squares += pull * pull / static_cast<double>(batch_lanes * num_parameters);
    }
    for (const SessionFit& fit : found.session_fits) {
      chi_squared += fit.chi_squared;
      freedom += fit.degrees_of_freedom;
    }
  }
  for (std::size_t i = 0; i < num_parameters; ++i) {
    EXPECT_NEAR(means[i] / bound.standard_errors[i], 1.0, 0.03) << test::parameter_infos()[i].name;
  }
  EXPECT_NEAR(squares, 1.0, 0.45);
  EXPECT_NEAR(chi_squared / freedom, 1.0, 5.0 * std::sqrt(2.0 / freedom) + 0.04);
}

TEST(PlanStudy, IsInfiniteForWhatNoSessionDetermines) {
  const auto study = study_plan(MicroscopeCampaign{});
  const PlanBound bound = study->bound(std::vector<int>(study->num_steps().size(), 0));
  for (const double error : bound.standard_errors) EXPECT_TRUE(std::isinf(error));
  EXPECT_NEAR(bound.misses_any, 1.0, 1e-12);
}

TEST(PlanStudy, RefusesSessionsThatItsMethodCannotUse) {
  MicroscopeCampaign campaign;
  campaign.scenario.sessions[0].spin_rate_rad_s = 1e-3;
  EXPECT_THROW((void)study_plan(campaign), ConfigError);
}

// What is written is read again as the plan that it is of.
TEST(PlanStudy, WritesTheCampaignThatItsBoundIsOf) {
  MicroscopeCampaign campaign;
  campaign.scenario.estimation.transient_s = 3000.0;
  const auto study = study_plan(campaign);
  std::vector<int> orbits = study->num_steps();
  orbits[3] = 37;
  const MicroscopeCampaign written =
      parse_campaign("written", study->campaign_file(orbits), {}, {});
  EXPECT_EQ(estimation_method(written.scenario.estimation.method).name, "joint");
  EXPECT_EQ(written.num_runs, campaign.num_runs);
  const auto again = study_plan(written);
  EXPECT_EQ(again->num_steps(), orbits);
  EXPECT_EQ(again->bound(orbits).standard_errors, study->bound(orbits).standard_errors);
  orbits[4] = 1;  // Less than twice the transient.
  EXPECT_THROW((void)study->campaign_file(orbits), ConfigError);
}

}  // namespace
}  // namespace proofmass
