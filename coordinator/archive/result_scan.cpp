#include "coordinator/archive/result_scan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <span>

#include "coordinator/archive/export.hpp"
#include "coordinator/archive/result_columns.hpp"
#include "coordinator/report/digest.hpp"

namespace proofmass::coordinator {
namespace {

/// Holds results against what a simulation can yield.
class Rules {
 public:
  Rules(std::uint64_t num_runs, std::int64_t num_rounds_max, ResultScan& scan)
      : num_runs_(num_runs), num_rounds_max_(num_rounds_max), scan_(scan) {}

  void check(const RunResult& result) {
    if (result.run.value >= num_runs_) {
      violate(result.run, fmt::format("must be below num_runs = {}", num_runs_));
    }
    for (const std::string& broken : broken_count_rules(result, num_rounds_max_)) {
      violate(result.run, broken);
    }
    for (const ValueColumn& column : value_columns()) {
      if (column.name.starts_with("error_")) continue;  // Follow from the others.
      const std::optional<double> value = column.value_in(result);
      if (!value || is_in_range(*value)) continue;
      violate(result.run, fmt::format("{} = {} (must be in [{}, {}])", column.name, *value,
                                      -magnitude_max, magnitude_max));
    }
  }

  void violate(RunIndex run, const std::string& what) {
    if (scan_.num_violations++ >= violations_named_max) return;
    scan_.violations.push_back(fmt::format("run {}: {}", run.value, what));
  }

 private:
  std::uint64_t num_runs_;
  std::int64_t num_rounds_max_;
  ResultScan& scan_;
};

std::vector<RunIndex> delivered_runs(const Store& store) {
  std::vector<RunIndex> runs;
  for (const RunRange& range : store.finished_runs()) {
    for (std::uint64_t run = range.first.value; run < range.end(); ++run) runs.push_back({run});
  }
  return runs;
}

std::vector<RunIndex> missing_in(std::span<const RunIndex> those, std::span<const RunIndex> these) {
  std::vector<RunIndex> missing;
  std::ranges::set_difference(these, those, std::back_inserter(missing));
  return missing;
}

}  // namespace

ResultScan scan_results(const Store& store, const Scenario& scenario, const IsStopped& is_stopped) {
  ResultScan scan{.runs = {},
                  .digest = {},
                  .accumulator = StatisticsAccumulator(scenario.objectives),
                  .num_violations = 0,
                  .violations = {}};
  Rules rules(store.num_runs(), scenario.estimation.num_rounds_max, scan);
  Digest digest;
  walk_results(store, is_stopped, [&](const RunResult& result) {
    rules.check(result);
    digest.add(result);
    if (scan.runs.empty() || scan.runs.back() < result.run) {
      scan.accumulator.add(result);
    } else {
      rules.violate(result.run, "is out of order");  // In a damaged tree.
    }
    scan.runs.push_back(result.run);
  });
  const std::vector<RunIndex> delivered = delivered_runs(store);
  scan.digest = digest.finish();
  for (const RunIndex run : missing_in(scan.runs, delivered)) {
    rules.violate(run, "has a delivery and no result");
  }
  for (const RunIndex run : missing_in(delivered, scan.runs)) {
    rules.violate(run, "has a result and no delivery");
  }
  return scan;
}

}  // namespace proofmass::coordinator
