#include "coordinator/archive/result_scan.hpp"

#include <fmt/format.h>

#include <optional>
#include <span>

#include "coordinator/archive/result_columns.hpp"
#include "coordinator/report/digest.hpp"
#include "core/campaign/model.hpp"

namespace proofmass::coordinator {
namespace {

/// Holds results against what a simulation can yield.
class Rules {
 public:
  Rules(std::int64_t num_rounds_max, ResultScan& scan)
      : num_rounds_max_(num_rounds_max), scan_(scan) {}

  void check(const RunResult& result) {
    for (const std::string& broken :
         broken_count_rules(result, model().results().num_draws_max, num_rounds_max_)) {
      violate(result.run, broken);
    }
    for (const ValueColumn& column : value_columns()) {
      if (column.kind == ValueKind::error) continue;  // Follow from the others.
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
  std::int64_t num_rounds_max_;
  ResultScan& scan_;
};

/// Reports each of these runs that is not one of those; both ascending.
void violate_missing(std::span<const RunRange> those, std::span<const RunRange> these,
                     const std::string& what, Rules& rules) {
  auto next = those.begin();
  for (const RunRange& range : these) {
    for (std::uint64_t run = range.first.value; run < range.end();) {
      while (next != those.end() && next->end() <= run) ++next;
      if (next != those.end() && next->first.value <= run) {
        run = next->end();  // All of these are there.
        continue;
      }
      rules.violate(RunIndex{run++}, what);
    }
  }
}

}  // namespace

ResultScan scan_results(const Store& store, const Campaign& campaign, const IsStopped& is_stopped) {
  ResultScan scan;
  Rules rules(campaign.num_rounds_max(), scan);
  Digest digest;
  std::uint64_t num_visits = 0;
  store.for_each_result([&](const RunResult& result) {
    constexpr std::uint64_t visits_between_questions = 1024;
    if (num_visits++ % visits_between_questions == 0 && is_stopped()) throw Interrupted();
    rules.check(result);
    digest.add(result);
    append(scan.runs, result.run);
  });
  scan.digests = digest.finish();
  const std::vector<RunRange> delivered = store.finished_runs();
  violate_missing(scan.runs, delivered, "has a delivery and no result", rules);
  violate_missing(delivered, scan.runs, "has a result and no delivery", rules);
  return scan;
}

}  // namespace proofmass::coordinator
