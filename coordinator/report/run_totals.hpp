#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/statistics/value_passes.hpp"

namespace proofmass::coordinator {

/// The budget totals that the errors of single runs leave, m/s². The total of the worst errors of
/// all parameters is larger: no run has them all.
struct RunTotals {
  double worst = 0.0;
  RunIndex worst_run;  ///< The first run that reaches `worst`.
  double median = 0.0;
  double percentile_95 = 0.0;
};

/// Computes them of results that are seen in passes, see ValuePasses.
class RunTotalPasses {
 public:
  explicit RunTotalPasses(ErrorBudget budget);

  /// Leaves out a result without an estimate.
  void add(const RunResult& result);
  /// @return True if another pass, with the same results, is needed.
  [[nodiscard]] bool end_pass();
  /// Empty without a run that has an estimate. @pre No further pass is needed.
  [[nodiscard]] std::optional<RunTotals> totals() const;

 private:
  ErrorBudget budget_;
  ValuePasses passes_;
  std::vector<double> errors_;  // Of the last result.
  RunTotals totals_;
  bool is_first_ = true;  ///< No total was added in any pass.
};

}  // namespace proofmass::coordinator
