#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/charts/chart.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/run_result.hpp"
#include "core/statistics/interval.hpp"

namespace proofmass::coordinator {

/// Counts of values between edges: what a histogram shows.
struct Histogram {
  std::vector<double> edges;  ///< Ascending; one more than there are counts. None: no value.
  std::vector<std::uint64_t> counts;  ///< Of the values in [edges[i], edges[i + 1]).
  std::uint64_t num_below = 0;        ///< Values below the first edge.
};

/// Counts magnitudes, ten bins a power of ten. Memory is fixed. Zeros, and what is below 1e-120,
/// have no bin.
class MagnitudeBins {
 public:
  MagnitudeBins();

  /// @param value  ≥ 0, at most 1e91.
  void add(double value);

  /// From the first bin with a value to the last.
  [[nodiscard]] Histogram histogram() const;

 private:
  std::uint64_t num_zero_ = 0;
  std::vector<std::uint64_t> counts_;
};

/// Counts values of either sign in at most 64 bins of equal width between the least and the
/// largest. The width is the smallest power of two with which all values have a bin, and no less
/// than 2^-24 of the largest |value|: it depends on these values alone, not on the order.
class ErrorBins {
 public:
  ErrorBins();

  /// @param value  Between -1e91 and 1e91.
  void add(double value);

  /// From the first bin with a value to the last.
  [[nodiscard]] Histogram histogram() const;

 private:
  void double_width();

  int exponent_;                            ///< Bins are 2^exponent wide.
  std::map<double, std::uint64_t> counts_;  ///< By the number of the bin, floor(value / width).
};

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

/// Whether the standard errors of a quantity say how far its estimates are off: over the completed
/// runs that have them. Of honest ones squared_ratio is 1, and 95 % of the errors are within
/// normal_95 of them.
struct StandardErrorStatistic {
  std::size_t quantity = 0;  ///< Index into the quantities of the ResultSchema.
  std::uint64_t num_runs = 0;
  double mean = 0.0;  ///< Of the standard errors, SI.
  /// Mean of error² over the mean of the standard errors' squares; nothing if these are 0.
  std::optional<double> squared_ratio = {};
  /// Its standard deviation if the standard errors are those of normal errors, √(2 Σσ⁴)/Σσ².
  std::optional<double> squared_ratio_error = {};
  std::uint64_t num_within = 0;  ///< Runs whose |error| is within normal_95 standard errors.
  /// Of their share among all draws, 95 %; of a sampling design from its replicates.
  std::optional<Interval> within = {};
  Histogram pulls = {};  ///< Of error / standard error.
};

/// Half the width of the interval, in standard deviations, that holds 95 % of a normal law.
inline constexpr double normal_95 = 1.96;

struct StandardErrorStatistics {
  std::vector<StandardErrorStatistic> quantities;  ///< None if no run has standard errors.
  std::vector<FitStatistic> fit;  ///< Of these runs: all data first, then each session, if any.
};

/// Computes them from results that are seen once. Memory is fixed.
class RunningStandardErrors {
 public:
  /// @param are_draws_independent  Else there are no intervals, chances and standard errors of
  ///                               ratios.
  explicit RunningStandardErrors(const ResultSchema& schema, bool are_draws_independent = true);

  /// @pre The result has what the schema says of its fit.
  void add(const RunResult& result);
  [[nodiscard]] StandardErrorStatistics statistics() const;

 private:
  struct Sums {
    double errors = 0.0;         ///< Of the standard errors.
    double squares = 0.0;        ///< Of the squares of the standard errors.
    double unit = 0.0;           ///< A power of two near the first standard error above 0.
    double fourth_powers = 0.0;  ///< Of those of the standard errors, in this unit.
    double squared_errors = 0.0;
    std::uint64_t num_within = 0;
    ErrorBins pulls;
  };
  /// Of a session, over the runs; x is χ² and n its degrees of freedom.
  struct FitSums {
    double x = 0.0, n = 0.0, xx = 0.0, xn = 0.0, nn = 0.0;
  };
  void add_fit(const RunResult& result);
  [[nodiscard]] static bool has_part(const FitSums& sums);
  [[nodiscard]] FitStatistic fit_of(const std::string& session, const FitSums& sums) const;

  bool are_draws_independent_;
  double fit_tolerance_;
  std::vector<std::size_t> indices_;  ///< Of the quantities that have a standard error.
  std::uint64_t num_runs_ = 0;
  std::vector<Sums> quantities_;       ///< Of these.
  std::vector<std::string> sessions_;  ///< All data first; none without a fit.
  std::vector<FitSums> fit_;
};

/// No rows without standard errors; no columns of intervals if no quantity has one.
[[nodiscard]] Table standard_error_table(const ResultSchema& schema,
                                         const StandardErrorStatistics& statistics);

/// That table, and that of the fit.
[[nodiscard]] std::vector<Table> standard_error_tables(const ResultSchema& schema,
                                                       const StandardErrorStatistics& statistics);

/// Error over standard error of each quantity beside the normal law that it should follow; nothing
/// without standard errors.
[[nodiscard]] std::optional<ChartGrid> pull_overview(const ResultSchema& schema,
                                                     const StandardErrorStatistics& statistics);

/// A row for each, which says whether it fits. No rows without a fit.
[[nodiscard]] Table fit_table(const ResultSchema& schema, const std::vector<FitStatistic>& fit);

}  // namespace proofmass::coordinator
