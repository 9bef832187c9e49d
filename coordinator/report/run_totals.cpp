#include "coordinator/report/run_totals.hpp"

#include <cmath>
#include <utility>

namespace proofmass::coordinator {

RunTotalPasses::RunTotalPasses(ErrorBudget budget)
    : budget_(std::move(budget)), passes_({.levels = {0.5, 0.95}}) {}

void RunTotalPasses::add(const RunResult& result) {
  if (!result.has_estimate()) return;
  errors_.resize(result.estimate.size());
  for (std::size_t i = 0; i < errors_.size(); ++i) errors_[i] = std::abs(result.error(i));
  const double total = budget_.after(errors_).total;
  passes_.add(total);
  if (!is_first_ && total <= totals_.worst) return;
  is_first_ = false;
  totals_.worst = total;
  totals_.worst_run = result.run;
}

bool RunTotalPasses::end_pass() { return passes_.end_pass(); }

std::optional<RunTotals> RunTotalPasses::totals() const {
  if (passes_.count() == 0) return std::nullopt;
  RunTotals totals = totals_;
  totals.median = passes_.percentile(0.5);
  totals.percentile_95 = passes_.percentile(0.95);
  return totals;
}

}  // namespace proofmass::coordinator
