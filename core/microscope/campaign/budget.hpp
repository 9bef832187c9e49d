#pragma once

#include <array>
#include <cstddef>

#include "core/campaign/campaign.hpp"
#include "core/microscope/results/results.hpp"

namespace proofmass {

struct Scenario;

/// Levels and bounds behind the budget tables ([Hardy2013] tab:Budget, tab:Budget_cali).
struct BudgetConfig {
  double t_xy_s2 = 3.0e-11;            ///< T_xy at f_EP, from 1.4 mrad of tilt.
  double residual_m_s2 = 1e-12;        ///< Drag-free residue at f_EP.
  double differential_m_s2 = 1.43e-8;  ///< Γ_app,d at DC.
  double offcentring_max_m = 20e-6;
  double scale_factor_error_max = 1e-2;
  double quadratic_factor_max_s2_m = 14000.0;
};

inline constexpr std::size_t num_budget_entries = 10;

/// The disturbing terms of [Hardy2013] tab:Budget and tab:Budget_cali in the paper's order, with
/// its figures, m/s².
[[nodiscard]] const std::array<BudgetEntryInfo, num_budget_entries>& budget_entry_infos();

/// The paper's own totals, m/s².
inline constexpr BudgetEntryInfo budget_total_info{"total", "Total", 2e-13, 1.1e-15, 3.6e-16};

/// Budget, contributions to the test of the equivalence principle, full difference, m/s², from the
/// construction bounds, before any calibration ([Hardy2013] tab:Budget). The gravity gradient of an
/// entry is that at f_EP in the session that finds the entry's parameter: T(f_orb) in inertial
/// pointing, and none to first order in the eccentricity where that session spins.
[[nodiscard]] Budget budget_before_calibration(const Scenario& scenario);

/// Budget left by estimation errors ([Hardy2013] tab:Budget_cali); linear in them.
/// @param errors  |estimate − truth| of each parameter, SI.
[[nodiscard]] Budget budget_after_calibration(const Scenario& scenario,
                                              const ParameterArray& errors);

/// Both, with a note about sessions that spin.
[[nodiscard]] ErrorBudget microscope_budget(const Scenario& scenario);

}  // namespace proofmass
