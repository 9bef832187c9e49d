#include "coordinator/store/detail/statistic_rows.hpp"

#include <cstddef>
#include <optional>

namespace proofmass::coordinator::detail {
namespace {

double entry_of(const Budget& budget, std::size_t i) {
  return i < num_budget_entries ? budget.entries[i] : budget.total;
}

std::optional<double> entry_of(const Budget* budget, std::size_t i) {
  return budget == nullptr ? std::nullopt : std::optional(entry_of(*budget, i));
}

}  // namespace

void replace_statistics(Database& database, const CampaignStatistics& statistics) {
  database.execute("DELETE FROM statistic");
  if (statistics.num_estimated == 0) return;
  Statement insert = database.prepare("INSERT INTO statistic VALUES (?, ?, ?, ?, ?, ?, ?)");
  for (const ParameterInfo& info : parameter_infos()) {
    const AccuracyStatistic& accuracy = statistics.accuracy[index(info.parameter)];
    insert.run(info.name, statistics.num_estimated, accuracy.worst, accuracy.worst_run.value,
               accuracy.mean, accuracy.standard_deviation, accuracy.num_beyond_objective);
  }
}

void replace_budgets(Database& database, const Budgets& budgets) {
  database.execute("DELETE FROM budget_entry");
  Statement insert =
      database.prepare("INSERT INTO budget_entry VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (std::size_t i = 0; i <= num_budget_entries; ++i) {
    const BudgetEntryInfo& info =
        i < num_budget_entries ? budget_entry_infos()[i] : budget_total_info;
    insert.run(i + 1, info.name, info.label, entry_of(budgets.before, i),
               entry_of(budgets.after_worst, i), entry_of(budgets.after_mean, i), info.paper_before,
               info.paper_after_worst, info.paper_after_mean);
  }
}

}  // namespace proofmass::coordinator::detail
