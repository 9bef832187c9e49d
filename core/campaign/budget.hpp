#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "core/campaign/parameter.hpp"
#include "core/campaign/scenario.hpp"

namespace proofmass {

inline constexpr std::size_t num_budget_entries = 10;

/// A disturbing term of [Hardy2013] tab:Budget and tab:Budget_cali, with the paper's figures, m/s².
struct BudgetEntryInfo {
  std::string_view name;   ///< In SQL: `t_xx_delta_x`.
  std::string_view label;  ///< For people: `a_c11·T_xx·Δx`.
  double paper_before;
  double paper_after_worst;
  double paper_after_mean;
};

/// The entries in the paper's order.
[[nodiscard]] const std::array<BudgetEntryInfo, num_budget_entries>& budget_entry_infos();

/// The paper's own totals, m/s².
inline constexpr BudgetEntryInfo budget_total_info{"total", "Total", 2e-13, 1.1e-15, 3.6e-16};

/// Contributions to the test of the equivalence principle, full difference, m/s².
struct Budget {
  std::array<double, num_budget_entries> entries{};
  double total = 0.0;  ///< Plain sum of the entries.
};

/// Budget from the construction bounds, before any calibration ([Hardy2013] tab:Budget). The
/// gravity gradient of an entry is that at f_EP in the session that finds the entry's parameter:
/// T(f_orb) in inertial pointing, and none to first order in the eccentricity where that session
/// spins.
[[nodiscard]] Budget budget_before_calibration(const Scenario& scenario);

/// Budget left by estimation errors ([Hardy2013] tab:Budget_cali); linear in them.
/// @param errors  |estimate − truth| of each parameter, SI.
[[nodiscard]] Budget budget_after_calibration(const Scenario& scenario,
                                              const ParameterArray& errors);

/// What an |error| of 1 (SI) of each parameter leaves in each entry, m/s²: the sum of coefficient
/// times |error| over the parameters is that entry of budget_after_calibration(), but for rounding.
[[nodiscard]] std::array<ParameterArray, num_budget_entries> budget_coefficients(
    const Scenario& scenario);

}  // namespace proofmass
