#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/campaign/identifiers.hpp"
#include "core/campaign/parameter.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass {

/// |estimate − truth| of one parameter over the runs that have an estimate.
struct AccuracyStatistic {
  double worst = 0.0;                      ///< SI.
  RunIndex worst_run;                      ///< The first run that reaches `worst`.
  double mean = 0.0;                       ///< SI.
  double standard_deviation = 0.0;         ///< SI, with n − 1; 0 for a single run.
  std::uint64_t num_beyond_objective = 0;  ///< Runs whose |error| is above the objective.
};

/// Statistics of a campaign's finished runs.
struct CampaignStatistics {
  std::uint64_t num_runs = 0;       ///< Finished runs, whatever their status.
  std::uint64_t num_estimated = 0;  ///< Those that have an estimate: the basis of `accuracy`.
  std::uint64_t num_not_converged = 0;
  std::uint64_t num_not_finite = 0;
  std::uint64_t num_no_draw = 0;
  /// Indexed by `index(parameter)`; all zero if num_estimated = 0.
  std::array<AccuracyStatistic, num_parameters> accuracy{};

  /// The worst |error| of each parameter, SI.
  [[nodiscard]] ParameterArray worst_errors() const;
  /// The mean |error| of each parameter, SI.
  [[nodiscard]] ParameterArray mean_errors() const;
};

/// Sum whose rounding error does not grow with the number of terms [Neumaier1974]: what each
/// addition loses is added up apart.
class CompensatedSum {
 public:
  void add(double term);
  [[nodiscard]] double value() const { return sum_ + lost_; }

 private:
  double sum_ = 0.0;
  double lost_ = 0.0;
};

/// Accumulates results in run order, so that the statistics do not depend on the order in which
/// runs arrived at the store. Keeps 80 bytes a run: the standard deviation takes a second pass.
class StatisticsAccumulator {
 public:
  /// @param objectives  Largest acceptable |error| of each parameter, SI.
  explicit StatisticsAccumulator(const ParameterArray& objectives) : objectives_(objectives) {}

  /// @pre Runs are added in strictly ascending order.
  void add(const RunResult& result);
  [[nodiscard]] CampaignStatistics statistics() const;

 private:
  [[nodiscard]] AccuracyStatistic accuracy(Parameter parameter) const;

  ParameterArray objectives_;
  CampaignStatistics counts_;
  std::optional<RunIndex> last_run_;
  std::vector<RunIndex> estimated_runs_;
  std::array<std::vector<double>, num_parameters> errors_;  ///< |error| of estimated_runs_.
};

}  // namespace proofmass
