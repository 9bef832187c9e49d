#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/archive/verification.hpp"
#include "coordinator/report/digest.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/report/summarise.hpp"
#include "coordinator/store/result_columns.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {
namespace {

/// Holds results against what a simulation can yield.
class Rules {
 public:
  Rules(const ResultSchema& schema, std::int64_t num_rounds_max, ResultScan& scan)
      : columns_(value_columns(schema)),
        num_draws_max_(schema.num_draws_max),
        num_rounds_max_(num_rounds_max),
        scan_(scan) {}

  void check(const RunResult& result) {
    for (const std::string& broken : broken_count_rules(result, num_draws_max_, num_rounds_max_)) {
      violate(result.run, broken);
    }
    for (const ValueColumn& column : columns_) {
      if (column.kind == ValueKind::error) continue;  // Follow from the others.
      const std::optional<double> value = column.value_in(result);
      if (!value || is_in_range(*value)) continue;
      violate(result.run, fmt::format("{} = {} (must be in [{}, {}])", column.name, *value,
                                      -magnitude_max, magnitude_max));
    }
  }

  void violate(RunIndex run, const std::string& what) {
    if (scan_.num_violations++ >= details_named_max) return;
    scan_.violations.push_back(fmt::format("run {}: {}", run.value, what));
  }

 private:
  std::vector<ValueColumn> columns_;
  std::uint32_t num_draws_max_;
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

constexpr std::string_view unfit = "not what follows from definition and results";

using Lines = std::vector<std::string>;

void append(Lines& lines, const Lines& further) {
  std::ranges::copy(further, std::back_inserter(lines));
}

Lines count_differences(const Summary& stored, const CampaignStatistics& now) {
  Lines lines;
  const auto require_same = [&](std::string_view column, std::uint64_t count, std::uint64_t must) {
    if (count == must) return;
    lines.push_back(fmt::format("summary.{} = {} (must be {})", column, count, must));
  };
  require_same("num_estimated", stored.num_estimated, now.num_estimated);
  require_same("num_not_converged", stored.num_not_converged, now.num_not_converged);
  require_same("num_not_finite", stored.num_not_finite, now.num_not_finite);
  require_same("num_no_draw", stored.num_no_draw, now.num_no_draw);
  require_same("num_lost", stored.num_lost, now.num_lost);
  require_same("num_within_objectives", stored.num_within_objectives, now.num_within_objectives);
  if (stored.within_objectives != now.within_objectives(stored.num_given_up)) {
    lines.emplace_back(
        "summary.within_objectives_lower and _upper (must be those of num_within_objectives)");
  }
  return lines;
}

// A run is given up after the summary without another result, and remains so until it has one: of
// as many results it cannot have been more.
Lines given_up_differences(const Store& store, const Summary& summary) {
  const std::uint64_t num_given_up = num_runs_in(store.given_up_runs());
  if (summary.num_given_up <= num_given_up) return {};
  return {fmt::format("summary.num_given_up = {} (must be at most {})", summary.num_given_up,
                      num_given_up)};
}

Check check_current(const Store& store, const Campaign& campaign, const Summary& summary,
                    const ReadResults& results) {
  Lines lines = count_differences(summary, results.statistics);
  append(lines, given_up_differences(store, summary));
  append(lines, store.statistic_differences(results.statistics, campaign.error_budget(),
                                            results.warnings.first));
  if (!lines.empty()) return Check::fails(std::string(unfit), std::move(lines));
  return Check::holds(
      fmt::format("of {} runs: every number and every budget", results.statistics.num_runs));
}

// Without a summary nothing was ever stored but the budget before estimation.
Check check_first(const Store& store, const Campaign& campaign) {
  Lines lines = store.statistic_differences({}, campaign.error_budget(), {});
  if (!lines.empty()) return Check::fails(std::string(unfit), std::move(lines));
  return Check::not_checked("none are stored: a coordinator has the file, or was killed");
}

}  // namespace

ResultScan scan_results(const Store& store, const Campaign& campaign, const IsStopped& is_stopped) {
  ResultScan scan;
  Rules rules(store.schema(), campaign.num_rounds_max(), scan);
  Digest digest(store.schema());
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

Check check_stored_statistics(const Store& store, const Campaign& campaign,
                              const ResultScan& scan) {
  const std::optional<Summary> summary = store.summary();
  if (!summary) return check_first(store, campaign);
  if (summary->num_finished == num_runs_in(scan.runs) && summary->digests == scan.digests &&
      scan.num_violations == 0) {
    return check_current(store, campaign, *summary, read_results(store, campaign));
  }
  const std::uint64_t num_counted = summary->num_estimated + summary->num_not_converged +
                                    summary->num_not_finite + summary->num_no_draw +
                                    summary->num_lost;
  if (num_counted != summary->num_finished) {
    return Check::fails(std::string(unfit),
                        {fmt::format("summary.num_finished = {} (must be {}, the sum of its kinds)",
                                     summary->num_finished, num_counted)});
  }
  return Check::not_checked("they are not of the results that are in the file");
}

Check check_stored_stop_checks(const Store& store, const Campaign& campaign,
                               const ResultScan& scan) {
  if (scan.num_violations > 0) return Check::not_checked("a result breaks its rule");
  Lines lines = stop_check_differences(store, campaign.objectives());
  if (!lines.empty()) return Check::fails(std::string(unfit), std::move(lines));
  const auto num_checks = static_cast<std::uint64_t>(store.stop_checks().size());
  return Check::holds(num_checks == 0 ? "none" : fmt::format("{} of a stop rule", num_checks));
}

Check check_contradictions(const Store& store) {
  const std::uint64_t num_compared = store.num_compared();
  const std::vector<Contradiction> contradictions = store.contradictions();
  if (contradictions.empty()) {
    return Check::holds(num_compared == 0
                            ? "no run was computed twice"
                            : fmt::format("{} second {}: each is the stored one", num_compared,
                                          num_compared == 1 ? "result" : "results"));
  }
  Lines lines;
  for (const Contradiction& found : contradictions) {
    lines.push_back(fmt::format("run {}: {} delivered {} (must be {}, as stored)", found.run.value,
                                found.worker, found.second_digest, found.stored_digest));
  }
  return Check::fails(
      fmt::format("{} of {} second results {} not the stored one: a worker computes "
                  "wrongly",
                  contradictions.size(), num_compared, contradictions.size() == 1 ? "is" : "are"),
      std::move(lines));
}

}  // namespace proofmass::coordinator
