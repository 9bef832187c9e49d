#pragma once

#include <optional>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/records.hpp"
#include "core/campaign/budget.hpp"
#include "core/campaign/statistics.hpp"

namespace proofmass::coordinator::detail {

/// Replaces the rows of `statistic`; leaves none if no run has an estimate.
void replace_statistics(Database& database, const CampaignStatistics& statistics);

/// Replaces the row of `summary`.
void replace_summary(const Database& database, const CampaignStatistics& statistics,
                     const ResultDigests& digests);
[[nodiscard]] std::optional<Summary> read_summary(const Database& database);

/// A campaign's three budgets; those after calibration are absent while no run has an estimate.
struct Budgets {
  const Budget& before;
  const Budget* after_worst;
  const Budget* after_mean;
};

/// Replaces the rows of `budget_entry`.
void replace_budgets(Database& database, const Budgets& budgets);

}  // namespace proofmass::coordinator::detail
