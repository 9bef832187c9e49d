#include "core/microscope/campaign/budget.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/instrument/drawn_sizes.hpp"
#include "core/microscope/results/health.hpp"

namespace proofmass {
namespace {

// 20 orbits, which the paper's test lasts at least, cannot tell closer lines apart.
bool is_line(double multiple, double of_line) { return std::abs(multiple - of_line) < 0.05; }

std::string test_note(const Scenario& scenario) {
  const double rate_rad_s = scenario.budget.test_spin_rate_rad_s;
  std::string note;
  if (rate_rad_s != 0.0)
    note = fmt::format("T is that of a test that turns by {} rad/s\n", rate_rad_s);
  const auto turns_so = [&](const Session& session) {
    return session.spin_rate_rad_s == rate_rad_s;
  };
  const auto is_tested_so = [&](const Session& session) {
    return is_test(session) && turns_so(session);
  };
  if (scenario.has_tests() && std::ranges::none_of(scenario.sessions, is_tested_so)) {
    note += fmt::format("No test of this campaign turns by budget.test_spin_rate_rad_s, {} rad/s\n",
                        rate_rad_s);
  }
  const bool is_elsewhere = std::ranges::any_of(scenario.sessions, [&](const Session& session) {
    const bool is_watched = scenario.has_tests() ? is_test(session) : session.excitations.empty();
    return is_watched && !turns_so(session);
  });
  if (!is_elsewhere) return note;
  note += scenario.has_tests()
              ? "Γ_res of a run is the largest of all tests, also of those that turn otherwise\n"
              : "Γ_res of a run is that at f_EP of calibration sessions in another pointing; the "
                "loop leaves more of the drag at a higher f_EP\n";
  return note;
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

std::size_t budget_level(const Scenario& scenario) {
  const std::size_t num_margins = scenario.has_plain_loops() ? 0 : margin_quantities().size();
  if (scenario.has_tests()) return num_health_values + num_margins;
  const auto level =
      std::ranges::find(health_values(), &LoopHealth::residual_m_s2, &HealthValue::member);
  return static_cast<std::size_t>(level - health_values().begin());
}

// With P_k and Q_k the harmonics of μ/r³ and of μ/r³ exp(2iν), and û = (cos ψ, 0, sin ψ) with
// ψ = ν + s M in a frame that turns s times a revolution, T_yy = −μ/r³, T_xx and T_zz are
// μ/r³ (½ ± 3/2 cos 2ψ), and T_xz is μ/r³ 3/2 sin 2ψ. A line of these is at f = 1 + s where
// k = f in μ/r³, and where k + 2s = ±f in the rest.
GradientLevels test_gradient_levels(const Scenario& scenario) {
  const double e = scenario.orbit.eccentricity;
  const double n = 2.0 * std::numbers::pi / scenario.orbit.period_s;
  const double s = scenario.budget.test_spin_rate_rad_s / n;
  const auto direction = [e](double k) {
    if (is_line(k, 1.0)) return -0.5 * e;
    if (is_line(k, 3.0)) return 3.5 * e;
    return is_line(k, 2.0) ? 1.0 : 0.0;
  };
  const double still = is_line(std::abs(1.0 + s), 1.0) ? 1.5 * e : 0.0;
  const double along = 1.5 * direction(1.0 - s);
  const double against = 1.5 * direction(-1.0 - 3.0 * s);
  const double level = n * n;
  return {.xx = level * std::abs(still + along + against),
          .xz = level * std::abs(along - against),
          .yy = level * 2.0 * still,
          .zz = level * std::abs(still - along - against)};
}

ErrorBudget microscope_budget(const Scenario& scenario, const DispersionSet& dispersions,
                              const std::vector<std::vector<double>>& table_columns) {
  using enum Parameter;
  const GradientLevels gradient = test_gradient_levels(scenario);
  const BudgetConfig& bound = scenario.budget;
  const AcceptanceConfig& acceptance = scenario.acceptance;
  const DrawnSizes sizes(dispersions, table_columns);
  // Element 1j of [M], η ± θ, is about the axis that is neither X nor j.
  const auto off_diagonal = [&](std::size_t axis) {
    return sizes.of_pair("misalignment_rad", axis) + sizes.of_pair("coupling_rad", axis);
  };
  const double a_c12_max = off_diagonal(2);
  const double a_c13_max = off_diagonal(1);
  const double a_d11_max = std::min(acceptance.a_d11_max, sizes.of_pair("scale_factor_error", 0));
  const auto delta = [&](std::size_t axis) {
    return std::max(bound.offcentring_max_m, sizes.of_axis("offcentring_m", axis));
  };
  const double a_c11 = 1.0 + bound.scale_factor_error_max;
  const double residual = bound.residual_m_s2;
  // A quadratic factor makes a line at f_EP from the product of a constant and the residue there;
  // Γ_d² holds that product twice.
  const double quadratic = bound.differential_m_s2 * residual;
  const double k2 = bound.quadratic_factor_max_s2_m;

  const auto& infos = budget_entry_infos();
  ErrorBudget budget{.title = "Budget of the test of the equivalence principle, m/s²",
                     .terms = {},
                     .total_info = budget_total_info,
                     .level = budget_level(scenario),
                     .level_label = "Γ_res",
                     .assumed_level = residual,
                     .note = test_note(scenario)};
  // What the tests of a run find enters no budget: that of the calibration is for them.
  const std::size_t num_quantities =
      num_parameters + (scenario.has_tests() ? num_test_parameters : 0);
  using Factors = std::initializer_list<std::pair<Parameter, double>>;
  const auto add = [&](double before, const Factors& factors, bool follows_level = false) {
    BudgetTerm term{.info = infos[budget.terms.size()],
                    .before = before,
                    .coefficients = std::vector<double>(num_quantities),
                    .follows_level = follows_level};
    for (const auto& [parameter, factor] : factors) term.coefficients[index(parameter)] = factor;
    budget.terms.push_back(std::move(term));
  };
  constexpr bool follows_level = true;
  add(gradient.xx * a_c11 * delta(0), {{a_c11_delta_x, gradient.xx}});
  add(gradient.xz * a_c11 * delta(2), {{a_c11_delta_z, gradient.xz}});
  add(bound.t_xy_s2 * a_c11 * delta(1), {{a_c11_delta_y, bound.t_xy_s2}});
  // The error of a product of two estimates, each as large as it may be; a_c11 = 1 here.
  add(gradient.yy * a_c12_max * delta(1),
      {{a_c12, gradient.yy * delta(1)}, {a_c11_delta_y, gradient.yy * a_c12_max}});
  add(gradient.zz * a_c13_max * delta(2),
      {{a_c13, gradient.zz * delta(2)}, {a_c11_delta_z, gradient.zz * a_c13_max}});
  add(2.0 * a_d11_max * residual, {{a_d11_prime, 2.0 * residual}}, follows_level);
  add(2.0 * std::min(acceptance.a_d1j_max_rad, a_c12_max) * residual, {{a_d12, 2.0 * residual}},
      follows_level);
  add(2.0 * std::min(acceptance.a_d1j_max_rad, a_c13_max) * residual, {{a_d13, 2.0 * residual}},
      follows_level);
  add(4.0 * k2 * quadratic, {{k2c, 4.0 * quadratic}}, follows_level);
  add(4.0 * k2 * quadratic, {{k2d, 4.0 * quadratic}}, follows_level);
  return budget;
}

}  // namespace proofmass
