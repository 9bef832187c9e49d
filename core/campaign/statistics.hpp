#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/runs.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"

namespace proofmass {

/// Percentiles of |error| that are reported: 0.99 for the 99th.
inline constexpr std::array percentile_levels{0.5, 0.9, 0.95, 0.99};

/// A percentile of |error|, SI.
struct PercentileStatistic {
  double level = 0.0;  ///< One of percentile_levels.
  double value = 0.0;
  std::optional<Interval> interval;  ///< Empty if runs are too few, 368 for the 99th.
};

/// estimate − truth of one quantity, signed, over the completed runs. SI.
struct ErrorStatistic {
  double bias = 0.0;                      ///< Mean.
  std::optional<Interval> bias_interval;  ///< Empty for a single run.
  double rms = 0.0;
  double standard_deviation = 0.0;             ///< With n − 1; 0 for a single run.
  std::optional<Interval> deviation_interval;  ///< By the kurtosis. Empty for a single run.
  double skewness = 0.0;                       ///< Adjusted, see Moments.
};

/// |estimate − truth| of one quantity over the completed runs. Intervals are of 95 %.
struct AccuracyStatistic {
  double worst = 0.0;                          ///< SI.
  RunIndex worst_run;                          ///< The first run that reaches `worst`.
  double mean = 0.0;                           ///< SI.
  double standard_deviation = 0.0;             ///< SI, with n − 1; 0 for a single run.
  double skewness = 0.0;                       ///< Adjusted, see Moments.
  std::uint64_t num_beyond_objective = 0;      ///< Runs whose |error| is above the objective.
  Interval beyond_objective;                   ///< Of the share of such runs among all draws.
  std::optional<Interval> mean_interval;       ///< Empty for a single run.
  std::optional<Interval> deviation_interval;  ///< bootstrap_deviation_interval().
  std::array<PercentileStatistic, percentile_levels.size()> percentiles{};
  ErrorStatistic error;  ///< With its sign.
};

/// A health quantity, SI.
struct HealthStatistic {
  double worst = 0.0;
  double mean = 0.0;
};

/// Statistics of a campaign's finished runs.
struct CampaignStatistics {
  std::uint64_t num_runs = 0;       ///< Finished runs, whatever their status.
  std::uint64_t num_estimated = 0;  ///< Completed runs: the basis of `accuracy`.
  std::uint64_t num_not_converged = 0;
  std::uint64_t num_not_finite = 0;
  std::uint64_t num_no_draw = 0;
  std::uint64_t num_lost = 0;
  /// Runs in which no |error| is above its objective; one that is not completed is none of them.
  std::uint64_t num_within_objectives = 0;
  /// Of each quantity; all zero if num_estimated = 0.
  std::vector<AccuracyStatistic> accuracy;
  /// Of each health quantity, over the runs that have an estimate; empty if they have none.
  std::vector<HealthStatistic> health = {};
  bool are_draws_independent = true;  ///< Else there is no interval; see leave_out_intervals().

  /// Of the share of runs within all objectives among all draws, 95 %.
  /// @param num_given_up  Runs that have no result, beside num_runs; they count as beyond.
  /// @return Nothing if there is no run, or if draws are not independent.
  [[nodiscard]] std::optional<Interval> within_objectives(std::uint64_t num_given_up) const;

  /// Counts a finished run by its status.
  void count(const RunResult& result);
};

/// The columns of a budget's table. With the worst errors the level is the worst of the runs, and
/// else their mean.
struct BudgetColumns {
  Budget before;
  std::optional<Budget> after_worst;  ///< Empty while no run has an estimate.
  std::optional<Budget> after_mean;   ///< Empty while no run has an estimate.
};
[[nodiscard]] BudgetColumns budget_columns(const ErrorBudget& budget,
                                           const CampaignStatistics& statistics);

/// Leaves what was seen of a campaign whose draws are not independent: no interval is true of it.
/// The interval of the share beyond an objective, which is always there, becomes 0 to 1.
void leave_out_intervals(CampaignStatistics& statistics);

/// The largest |error| of a quantity, and the runs beyond its objective.
struct ErrorExtremes {
  std::optional<double> worst;  ///< SI; empty before the first run.
  RunIndex worst_run;           ///< Of equal ones the first run, whatever their order.
  std::uint64_t num_beyond = 0;

  /// @return Whether |error| = `magnitude` is within the objective.
  bool add(RunIndex run, double magnitude, double objective);
};

/// Statistics of results that are seen once, in any order, and added while others are yet to come:
/// what CampaignStatistics has, but for the percentiles and the interval of the standard deviation
/// by the bootstrap, which need all results at once; see complete(). Memory is fixed; a copy costs
/// little.
///
/// Moments are corrected sums about the first value instead of the mean: they agree with those of
/// complete() to 1e-11 of the worst |error|. A standard deviation s loses ε D²/s, D being the
/// distance of the first value from the mean; as it is one of the n values, D < √n s, so that no
/// more than ε √n D is lost.
class RunningStatistics {
 public:
  /// @param objectives  Largest acceptable |error| of each quantity, SI.
  explicit RunningStatistics(std::vector<double> objectives);

  /// @pre The run was not added before.
  void add(const RunResult& result);
  [[nodiscard]] CampaignStatistics statistics() const;

 private:
  struct Quantity {
    MomentSums errors;      ///< estimate − truth.
    MomentSums magnitudes;  ///< |estimate − truth|.
    ErrorExtremes extremes = {};
  };

  std::vector<double> objectives_;
  CampaignStatistics counts_;
  std::vector<Quantity> quantities_;  ///< Empty before the first run with an estimate.
  std::vector<std::pair<double, CompensatedSum>> health_;  ///< Worst and sum of each.
  std::uint64_t num_with_health_ = 0;
};

/// Adds to RunningStatistics what needs all errors of a quantity at once, and computes its moments
/// about their mean. Errors in run order make statistics that do not depend on the order in which
/// results arrived.
/// @param accuracy  Of the same errors.
/// @param errors    estimate − truth of all completed runs, SI, at least one; afterwards |estimate
/// −
///                  truth| in ascending order.
void complete(AccuracyStatistic& accuracy, std::vector<double>& errors);

}  // namespace proofmass
