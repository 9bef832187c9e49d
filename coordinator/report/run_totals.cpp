#include "coordinator/report/run_totals.hpp"

#include <cmath>

namespace proofmass::coordinator {

RunTotalPasses::RunTotalPasses(const Scenario& scenario)
    : scenario_(scenario), passes_({.levels = {0.5, 0.95}}) {}

void RunTotalPasses::add(const RunResult& result) {
  if (!result.has_estimate()) return;
  ParameterArray errors{};
  for (const ParameterInfo& info : parameter_infos()) {
    errors[index(info.parameter)] = std::abs(result.error(info.parameter));
  }
  const double total = budget_after_calibration(scenario_, errors).total;
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
