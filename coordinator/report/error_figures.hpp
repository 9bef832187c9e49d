#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "coordinator/report/histogram.hpp"
#include "coordinator/report/requirements.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"

namespace proofmass::coordinator {

/// What the first n runs that have an estimate tell of |error|, SI.
struct ConvergencePoint {
  std::uint64_t num_runs = 0;
  double worst = 0.0;
  double mean = 0.0;
  std::optional<Interval> mean_interval;  ///< 95 %; empty for one run.
  double standard_deviation = 0.0;
  /// 95 %, by the kurtosis of the errors; empty below five runs. The bootstrap of the tables would
  /// need all errors at each point.
  std::optional<Interval> deviation_interval;
};

/// What the charts of one quantity show: binned or thinned, whatever the number of runs.
struct QuantityFigures {
  Histogram magnitudes;         ///< Of |error|, SI.
  Histogram errors;             ///< Of the error with its sign, SI.
  std::vector<RunValue> worst;  ///< The five largest |error|; of equal ones the first.
  std::vector<ConvergencePoint> convergence;  ///< At most 42, the last of all runs.
};

/// Adds a value to the largest ones, in descending order, if it is one of these; of equal ones the
/// first stays.
/// @param count  Of those that are kept; at least 1.
void keep_largest(const RunValue& candidate, std::size_t count, std::vector<RunValue>& largest);

/// For draws that are not independent.
void leave_out_intervals(QuantityFigures& figures);

/// The numbers of runs at which convergence is shown: 40 from 5 on, of at most 5 runs from 1 on,
/// equally spaced on a logarithmic axis. Ascending, without repetition.
/// @param num_runs  The last one, unless it is 0.
[[nodiscard]] std::vector<std::uint64_t> convergence_counts(std::uint64_t num_runs);

/// Computes them from results that are seen once, in run order. Memory is some 100 kB.
class ErrorFigures {
 public:
  /// @param num_runs  Finished runs, with an estimate or without.
  ErrorFigures(std::size_t num_quantities, std::uint64_t num_runs);

  void add(const RunResult& result);

  /// Of each quantity. To be called once, after all results.
  [[nodiscard]] std::vector<QuantityFigures> figures();

 private:
  struct Growing {
    MagnitudeBins magnitudes;
    ErrorBins errors;
    std::optional<MomentSums> sums;  ///< About the first |error|, which is of their size.
    QuantityFigures figures = {};    ///< Without the histograms, which are made at the end.
  };

  static void add_error(RunIndex run, double error, Growing& quantity);
  void add_convergence();

  std::uint64_t num_estimated_ = 0;
  std::vector<std::uint64_t> counts_;
  std::size_t next_count_ = 0;
  std::vector<Growing> quantities_;
};

}  // namespace proofmass::coordinator
