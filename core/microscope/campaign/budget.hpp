#pragma once

#include <array>
#include <cstddef>

#include "core/campaign/campaign.hpp"
#include "core/microscope/instrument/drawn_quantities.hpp"
#include "core/microscope/results/results.hpp"

namespace proofmass {

struct Scenario;

/// Levels and bounds behind the budget tables ([Hardy2013] tab:Budget, tab:Budget_cali).
struct BudgetConfig {
  /// Rate about Y at which the satellite turns while it tests the equivalence principle; 0 is
  /// inertial pointing. The calibration sessions have rates of their own.
  double test_spin_rate_rad_s = 0.0;
  double t_xy_s2 = 3.0e-11;            ///< T_xy at f_EP, from 1.4 mrad of tilt.
  double residual_m_s2 = 1e-12;        ///< Drag-free residue at f_EP where no run tells it.
  double differential_m_s2 = 1.43e-8;  ///< Γ_app,d at DC.
  double offcentring_max_m = 20e-6;    ///< Or what the laws draw, if that is larger.
  double scale_factor_error_max = 1e-2;
  double quadratic_factor_max_s2_m = 14000.0;
};

inline constexpr std::size_t num_budget_entries = 10;

/// The disturbing terms of [Hardy2013] tab:Budget and tab:Budget_cali in the paper's order, with
/// its figures, m/s².
[[nodiscard]] const std::array<BudgetEntryInfo, num_budget_entries>& budget_entry_infos();

/// The paper's own totals, m/s².
inline constexpr BudgetEntryInfo budget_total_info{"total", "Total", 2e-13, 1.1e-15, 3.6e-16};

/// Index of a budget's level among the health quantities: test_residual_quantity() if the scenario
/// has tests, LoopHealth::residual_m_s2 if not.
[[nodiscard]] std::size_t budget_level(const Scenario& scenario);

/// Amplitudes of elements of the gravity gradient at one frequency, s⁻².
struct GradientLevels {
  double xx = 0.0;
  double xz = 0.0;
  double yy = 0.0;
  double zz = 0.0;
};

/// Those at f_EP = f_orb + f_spin in the frame in which the test of the equivalence principle is
/// made, to first order in the eccentricity.
[[nodiscard]] GradientLevels test_gradient_levels(const Scenario& scenario);

/// Contributions to the test of the equivalence principle, full difference, m/s²: tab:Budget and
/// tab:Budget_cali with the gradient at f_EP of the test. What depends on the drag-free residue
/// follows that of the runs. a_c1j and a_d1j are as large as the laws of misalignment and coupling
/// let them be; before calibration a_d1j is within the acceptance bounds, too.
/// @param table_columns  As in Campaign: values of laws that are tables.
[[nodiscard]] ErrorBudget microscope_budget(
    const Scenario& scenario, const DispersionSet& dispersions = nominal_dispersions(),
    const std::vector<std::vector<double>>& table_columns = {});

}  // namespace proofmass
