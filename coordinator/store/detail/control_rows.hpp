#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/records.hpp"
#include "core/statistics/stop_rule.hpp"

namespace proofmass::coordinator::detail {

/// How the campaign is served: columns of `campaign`.
[[nodiscard]] CampaignControl read_control(const Database& database);
void write_control(const Database& database, const CampaignControl& control);

/// When the campaign ends early: columns of `campaign`.
[[nodiscard]] StopPlan read_stop_plan(const Database& database);
/// A new plan with a rule, not checked yet, leaves a campaign unfinished: `finished` is `active`.
void write_stop_plan(const Database& database, const StopPlan& plan);

/// See Store::num_runs_fixed().
[[nodiscard]] std::optional<std::uint64_t> read_num_runs_fixed(const Database& database);
/// While there is no result, nobody can have looked at one: the runs that are asked for now are
/// fixed, unless a stop rule decides about their number.
void fix_num_runs(const Database& database);

/// The row of `stop_check` with the most runs.
[[nodiscard]] std::optional<StoredStopCheck> read_last_stop_check(const Database& database,
                                                                  std::string_view statistic);
/// All rows of `stop_check`.
[[nodiscard]] std::vector<StopCheckRow> read_stop_checks(const Database& database);
/// A row of `stop_check`.
void replace_stop_check(const Database& database, std::uint64_t num_runs,
                        std::string_view statistic, const StopCheck& check);

/// The runs in the first column of a query, which are ascending; neighbours are one range.
[[nodiscard]] std::vector<RunRange> read_runs(const Database& database, std::string_view sql);

/// Runs that were blamed for losses and are neither finished nor given up, ascending.
[[nodiscard]] std::vector<BlamedRun> read_blamed_runs(const Database& database);

/// Rows of `audit` that are not equal, in run order.
[[nodiscard]] std::vector<Contradiction> read_contradictions(const Database& database);

void insert_start(const Database& database, const CoordinatorStart& start);
void end_start(const Database& database, wire::Epoch epoch);

}  // namespace proofmass::coordinator::detail
