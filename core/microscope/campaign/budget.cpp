#include "core/microscope/campaign/budget.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>
#include <string>

#include "core/microscope/campaign/scenario.hpp"

namespace proofmass {
namespace {

// Amplitudes at f_EP of the gravity gradient in a session's frame, s⁻², to first order in the
// eccentricity; T_xy comes from a tilt and is a level of the scenario.
struct GradientLevels {
  double xx;
  double xz;
  double yy;
  double zz;
};

// In an inertial frame f_EP = f_orb. In one that spins, the gradient has lines at f_orb, at 2 f_EP
// and at 2 f_EP ± f_orb, none of which is at f_EP = f_orb + f_spin.
GradientLevels gradient_levels(const Scenario& scenario, SessionTarget target) {
  const auto session = std::ranges::find(scenario.sessions, target, &Session::target);
  const bool is_spinning = session != scenario.sessions.end() && session->spin_rate_rad_s != 0.0;
  if (is_spinning) return {.xx = 0.0, .xz = 0.0, .yy = 0.0, .zz = 0.0};
  const OrbitConfig& orbit = scenario.orbit;
  const double mean_motion = 2.0 * std::numbers::pi / orbit.period_s;
  const double level = orbit.eccentricity * mean_motion * mean_motion;
  return {.xx = 0.75 * level, .xz = 0.75 * level, .yy = 3.0 * level, .zz = 2.25 * level};
}

// Each element in the session that finds the parameter of its entry.
GradientLevels entry_levels(const Scenario& scenario) {
  using enum SessionTarget;
  return {.xx = gradient_levels(scenario, a_c11_delta_x).xx,
          .xz = gradient_levels(scenario, a_c11_delta_z).xz,
          .yy = gradient_levels(scenario, a_c12).yy,
          .zz = gradient_levels(scenario, a_c13).zz};
}

// A quadratic factor makes a line at f_EP from the product of a constant and the residue there.
double quadratic_level(const BudgetConfig& budget) {
  return budget.differential_m_s2 * budget.residual_m_s2;
}

// In inertial pointing, the paper's, f_EP is f_orb and needs no word.
std::string test_frequency_note(const Scenario& scenario) {
  const auto spinning = std::ranges::count_if(
      scenario.sessions, [](const Session& session) { return session.spin_rate_rad_s != 0.0; });
  if (spinning == 0) return "";
  return fmt::format(
      "T at f_EP of the session that finds the parameter; {} of {} sessions spin, where T has no\n"
      "line at f_EP = f_orb + f_spin to first order in the eccentricity\n",
      spinning, scenario.sessions.size());
}

Budget with_total(const std::array<double, num_budget_entries>& entries) {
  Budget budget{.entries = {entries.begin(), entries.end()}};
  for (const double entry : entries) budget.total += entry;
  return budget;
}

}  // namespace

const std::array<BudgetEntryInfo, num_budget_entries>& budget_entry_infos() {
  // Figures of [Hardy2013]: tab:Budget, then tab:Budget_cali for the worst and the mean errors.
  static constexpr std::array<BudgetEntryInfo, num_budget_entries> infos{{
      {"t_xx_delta_x", "a_c11·T_xx·Δx", 8.4e-14, 1.7e-16, 4.2e-17},
      {"t_xz_delta_z", "a_c11·T_xz·Δz", 8.6e-14, 2.1e-16, 1.3e-16},
      {"t_xy_delta_y", "a_c11·T_xy·Δy", 6e-16, 6.0e-18, 1.5e-18},
      {"t_yy_delta_y", "a_c12·T_yy·Δy", 8.6e-16, 3.5e-16, 9.1e-17},
      {"t_zz_delta_z", "a_c13·T_zz·Δz", 6.4e-16, 2.9e-16, 8.2e-17},
      {"residual_x", "2·a_d11·Γ_res,x", 2e-14, 1.0e-17, 3.2e-18},
      {"residual_y", "2·a_d12·Γ_res,y", 3.0e-15, 3.7e-17, 2.4e-18},
      {"residual_z", "2·a_d13·Γ_res,z", 3.0e-15, 7.5e-18, 2.0e-18},
      {"common_quadratic", "4·K2c·Γ_d·Γ_res,x", 8.0e-16, 1.6e-17, 3.5e-18},
      {"differential_quadratic", "2·K2d·(Γ_d²+Γ_res,x²)", 8.0e-16, 7.1e-18, 1.4e-18},
  }};
  return infos;
}

Budget budget_before_calibration(const Scenario& scenario) {
  const GradientLevels gradient = entry_levels(scenario);
  const BudgetConfig& bound = scenario.budget;
  const AcceptanceConfig& acceptance = scenario.acceptance;
  const double delta = bound.offcentring_max_m;
  const double a_c11_delta = (1.0 + bound.scale_factor_error_max) * delta;
  const double k2 = bound.quadratic_factor_max_s2_m * quadratic_level(bound);
  return with_total({
      gradient.xx * a_c11_delta, gradient.xz * a_c11_delta, bound.t_xy_s2 * a_c11_delta,
      gradient.yy * acceptance.a_c1j_max_rad * delta,
      gradient.zz * acceptance.a_c1j_max_rad * delta,
      2.0 * acceptance.a_d11_max * bound.residual_m_s2,
      2.0 * acceptance.a_d1j_max_rad * bound.residual_m_s2,
      2.0 * acceptance.a_d1j_max_rad * bound.residual_m_s2, 4.0 * k2,
      2.0 * (2.0 * k2),  // Γ_d² holds the product of its constant and its line twice.
  });
}

Budget budget_after_calibration(const Scenario& scenario, const ParameterArray& errors) {
  using enum Parameter;
  const auto error = [&](Parameter parameter) { return errors[index(parameter)]; };
  const GradientLevels gradient = entry_levels(scenario);
  const BudgetConfig& bound = scenario.budget;
  const double delta_max = bound.offcentring_max_m;
  const double a_c1j_max = scenario.acceptance.a_c1j_max_rad;
  const double k2 = quadratic_level(bound);
  return with_total({
      gradient.xx * error(a_c11_delta_x),
      gradient.xz * error(a_c11_delta_z),
      bound.t_xy_s2 * error(a_c11_delta_y),
      // The error of a product of two estimates, each at most at its bound; a_c11 = 1 here.
      gradient.yy * (error(a_c12) * delta_max + a_c1j_max * error(a_c11_delta_y)),
      gradient.zz * (error(a_c13) * delta_max + a_c1j_max * error(a_c11_delta_z)),
      2.0 * error(a_d11_prime) * bound.residual_m_s2,
      2.0 * error(a_d12) * bound.residual_m_s2,
      2.0 * error(a_d13) * bound.residual_m_s2,
      4.0 * error(k2c) * k2,
      2.0 * error(k2d) * (2.0 * k2),
  });
}

ErrorBudget microscope_budget(const Scenario& scenario) {
  const auto& infos = budget_entry_infos();
  return {.title = "Budget of the test of the equivalence principle, m/s²",
          .infos = {infos.begin(), infos.end()},
          .total_info = budget_total_info,
          .before = budget_before_calibration(scenario),
          .after =
              [scenario](std::span<const double> errors) {
                ParameterArray of_parameters{};
                std::ranges::copy(errors, of_parameters.begin());
                return budget_after_calibration(scenario, of_parameters);
              },
          .note = test_frequency_note(scenario)};
}

}  // namespace proofmass
