#pragma once

#include <optional>
#include <string>
#include <vector>

#include "coordinator/table/table.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// How well estimates fit the data of a session, or all data, over the completed runs of a campaign
/// that have standard errors.
struct FitStatistic {
  std::string session;              ///< `all` for all data.
  double chi_squared = 0.0;         ///< Mean.
  double degrees_of_freedom = 0.0;  ///< Mean of what χ² is expected to be.
  double ratio = 0.0;               ///< Of these two; 0 without a degree of freedom.
  /// Of the ratio, over the runs; none of a single run or without a degree of freedom.
  std::optional<double> ratio_error = {};
  /// Chance that one of all these ratios is so far from 1 although the noise is what the method
  /// takes it for, to ResultSchema::fit_tolerance: by the χ² law and Bonferroni's inequality. Data
  /// that the fit adapts to in part scatter less than that law, so that it is never too small.
  std::optional<double> p_value = {};
};

/// Computes them from results that are seen once. Memory is fixed.
class RunningFit {
 public:
  explicit RunningFit(const ResultSchema& schema);

  /// @pre The result has what the schema says of its fit.
  void add(const RunResult& result);

  /// All data first, then each session; none before the first result or without a fit.
  [[nodiscard]] std::vector<FitStatistic> statistics() const;

 private:
  /// Over the runs; x is χ² and n its degrees of freedom.
  struct Sums {
    double x = 0.0, n = 0.0, xx = 0.0, xn = 0.0, nn = 0.0;
  };
  [[nodiscard]] FitStatistic statistic_of(const std::string& session, const Sums& sums) const;

  std::vector<std::string> sessions_;
  double tolerance_;
  double num_runs_ = 0.0;
  std::vector<Sums> sums_;
};

/// A row for each, which says whether it fits. No rows without a fit.
[[nodiscard]] Table fit_table(const ResultSchema& schema, const std::vector<FitStatistic>& fit);

}  // namespace proofmass::coordinator
