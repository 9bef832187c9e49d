#pragma once

#include "coordinator/store/detail/database.hpp"
#include "core/campaign/budget.hpp"
#include "core/campaign/statistics.hpp"

namespace proofmass::coordinator::detail {

/// Replaces the rows of `statistic`; leaves none if no run has an estimate.
void replace_statistics(Database& database, const CampaignStatistics& statistics);

/// A campaign's three budgets; those after calibration are absent while no run has an estimate.
struct Budgets {
  const Budget& before;
  const Budget* after_worst;
  const Budget* after_mean;
};

/// Replaces the rows of `budget_entry`.
void replace_budgets(Database& database, const Budgets& budgets);

}  // namespace proofmass::coordinator::detail
