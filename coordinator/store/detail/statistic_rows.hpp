#pragma once

#include <optional>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/records.hpp"
#include "core/campaign/error_budget.hpp"
#include "core/campaign/statistics.hpp"

namespace proofmass::coordinator::detail {

/// Replaces the rows of `statistic`; leaves none if no run has an estimate.
void replace_statistics(Database& database, const CampaignStatistics& statistics);

/// Replaces the row of `summary`.
void replace_summary(const Database& database, const CampaignStatistics& statistics,
                     const ResultDigests& digests);
[[nodiscard]] std::optional<Summary> read_summary(const Database& database);

/// Replaces the rows of `budget_entry`; those after calibration are absent while no run has an
/// estimate. Leaves none without a budget.
void replace_budgets(Database& database, const std::optional<ErrorBudget>& budget,
                     const CampaignStatistics& statistics);

}  // namespace proofmass::coordinator::detail
