#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace proofmass {

/// A term of an error budget, with its published figures.
struct BudgetEntryInfo {
  std::string_view name;   ///< In SQL: `t_xx_delta_x`.
  std::string_view label;  ///< For people: `a_c11·T_xx·Δx`.
  double paper_before;
  double paper_after_worst;
  double paper_after_mean;
};

/// Contributions to the measurement that a calibration serves.
struct Budget {
  std::vector<double> entries;  ///< Of each term.
  double total = 0.0;           ///< Plain sum of the entries.
};

/// What estimation errors leave in the measurement that the calibration serves, m/s². Every term is
/// linear in the errors |estimate − truth|.
struct ErrorBudget {
  std::string_view title;              ///< `Budget of the test of ..., m/s²`.
  std::vector<BudgetEntryInfo> infos;  ///< Of the terms.
  BudgetEntryInfo total_info;
  Budget before;  ///< From the construction bounds, before any calibration.
  /// Left by errors |estimate − truth| of each quantity, SI.
  std::function<Budget(std::span<const double>)> after;
  std::string note;  ///< What a reader of the table should know; may be empty.

  /// What an |error| of 1 (SI) of each of so many quantities leaves in each term: the sum of
  /// coefficient times |error| over the quantities is that entry of after(), but for rounding.
  /// @return shape [terms][num_quantities].
  [[nodiscard]] std::vector<std::vector<double>> coefficients(std::size_t num_quantities) const;
};

}  // namespace proofmass
