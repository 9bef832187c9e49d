#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/records.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/campaign/statistics.hpp"

namespace proofmass::coordinator::detail {

/// Replaces the rows of `statistic`; leaves none if no run has an estimate.
void replace_statistics(Database& database, const ResultSchema& results,
                        const CampaignStatistics& statistics);

/// Replaces the row of `summary`.
void replace_summary(const Database& database, const CampaignStatistics& statistics,
                     const ResultDigests& digests);

/// Replaces the rows of `run_warning`.
void replace_warnings(Database& database, const ResultSchema& results,
                      std::span<const RunWarning> warnings);

/// Replaces the rows of `budget_entry`; those after estimation are absent while no run has an
/// estimate. Leaves none without a budget.
void replace_budgets(Database& database, const std::optional<ErrorBudget>& budget,
                     const CampaignStatistics& statistics);

/// Runs that are kept for each parameter in `worst_run`.
inline constexpr std::size_t num_worst_runs = 10;

/// A run and its |error| of some parameter, SI.
struct RankedRun {
  double magnitude = 0.0;
  RunIndex run;

  bool operator==(const RankedRun&) const = default;
};

/// The runs with the largest |error| of one parameter: the same ones in whatever order runs come.
class WorstRuns {
 public:
  /// What became of a run that was offered.
  struct Change {
    bool is_taken = false;
    std::optional<RunIndex> dropped;  ///< In its place.
  };

  /// Takes a run if its |error| is among the largest; of equal ones the first run counts as larger.
  Change offer(const RankedRun& offered);

  /// Largest first.
  [[nodiscard]] const std::vector<RankedRun>& runs() const { return runs_; }

 private:
  std::vector<RankedRun> runs_;
};

/// The worst runs of each parameter, by its index.
using WorstRunTable = std::vector<WorstRuns>;

/// The rows of `worst_run`.
[[nodiscard]] WorstRunTable read_worst_runs(const Database& database, const ResultSchema& results);

/// Largest acceptable |error| of each parameter, SI; infinite if there is none.
[[nodiscard]] std::vector<double> read_objectives(const Database& database,
                                                  const ResultSchema& results);

/// Which parameters have an |error| above their objective: bit i for the one with index i.
[[nodiscard]] std::uint64_t exceeded_objectives(const RunResult& result,
                                                std::span<const double> objectives);

/// Keeps `overrun` and `worst_run` in step with `run_result`. Knows the rows that are there: to be
/// thrown away with a transaction that is rolled back.
class LargestErrorRows {
 public:
  /// @param results  Of the campaign; outlives the object.
  LargestErrorRows(const Database& database, const ResultSchema& results);

  /// @pre The result was stored just now, for the first time.
  void add(const RunResult& result);

 private:
  const ResultSchema& schema_;
  std::vector<double> objectives_;
  WorstRunTable worst_;
  Statement insert_overrun_;
  Statement insert_worst_;
  Statement delete_worst_;
};

}  // namespace proofmass::coordinator::detail
