#include "coordinator/report/report.hpp"

#include <fmt/format.h>

namespace proofmass::coordinator {

std::string report_text(const Store& store, const Scenario& scenario) {
  const CampaignStatistics statistics = read_statistics(store, scenario);
  return fmt::format("{}\n{}\n{}",
                     summary_text(store.name(), store.seed(), store.num_runs(), statistics),
                     accuracy_table(scenario, statistics), budget_table(scenario, statistics));
}

std::string summary_text(std::string_view name, std::uint64_t seed, std::uint64_t num_runs,
                         const CampaignStatistics& statistics) {
  const std::uint64_t num_imperfect =
      statistics.num_not_converged + statistics.num_not_finite + statistics.num_no_draw;
  std::string text =
      fmt::format("Campaign  {}\nSeed      {}\nRuns      {} finished of {}, {} completed\n", name,
                  seed, statistics.num_runs, num_runs, statistics.num_runs - num_imperfect);
  if (num_imperfect > 0) {
    text += fmt::format("          {} not converged, {} not finite, {} without draw\n",
                        statistics.num_not_converged, statistics.num_not_finite,
                        statistics.num_no_draw);
  }
  return text;
}

CampaignStatistics read_statistics(const Store& store, const Scenario& scenario) {
  StatisticsAccumulator accumulator(scenario.objectives);
  store.for_each_result([&](const RunResult& result) { accumulator.add(result); });
  return accumulator.statistics();
}

void update_statistics(Store& store, const Scenario& scenario) {
  const CampaignStatistics statistics = read_statistics(store, scenario);
  store.write_statistics(statistics, budget_before_calibration(scenario),
                         budget_after_calibration(scenario, statistics.worst_errors()),
                         budget_after_calibration(scenario, statistics.mean_errors()));
}

}  // namespace proofmass::coordinator
