#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "coordinator/table/table.hpp"
#include "core/campaign/run_result.hpp"
#include "core/runs.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/variance_components.hpp"

namespace proofmass::coordinator {

/// A share of runs, with the instrument as the unit of its interval.
struct GroupedShare {
  double share = 0.0;
  Interval interval;
};

/// Whether standard errors are honest over instruments and within each of them.
struct GroupedStandardErrors {
  double within_ratio = 0.0;  ///< Variance within instruments over the mean of σ².
  GroupedShare covered;       ///< |error| within normal_95 σ: 95 % if σ is honest over all.
  /// |error − mean of its instrument|·√(M/(M − 1)) within normal_95 σ: 95 % if σ is all noise, and
  /// more the more of it is the instrument's.
  GroupedShare covered_within;
};

/// Errors of one quantity in the instruments whose runs are all completed.
struct InstrumentQuantity {
  OneWayAnalysis error;
  double mean_magnitude = 0.0;
  std::optional<Interval> magnitude_interval;  ///< Of the mean |error|.
  GroupedShare beyond;                         ///< Runs whose |error| is above the objective.
  std::optional<GroupedStandardErrors> standard_errors;
};

/// What several realisations of the noise for each instrument tell.
struct InstrumentStatistics {
  std::uint64_t realisations = 0;
  std::uint64_t num_instruments = 0;  ///< Whose runs are all finished; so is the basis of `mixed`.
  std::uint64_t num_incomplete = 0;   ///< Of which a run has no result: left out.
  std::uint64_t num_not_estimated = 0;         ///< Finished, with a run without estimate.
  std::vector<InstrumentQuantity> quantities;  ///< Empty without a completed instrument.
  // All objectives hold, in the three interpretations of ECSS-E-ST-60-10C.
  GroupedShare mixed;     ///< Of all runs.
  GroupedShare ensemble;  ///< Of the instruments: in each of their realisations.
  double temporal = 0.0;  ///< Share of the realisations of the instrument that has the smallest.
  std::uint64_t temporal_instrument = 0;
};

/// Computes them from results in run order. Memory is fixed.
class RunningInstruments {
 public:
  /// @param objectives    Of each quantity, SI.
  /// @param realisations  At least 2.
  RunningInstruments(std::vector<double> objectives, std::uint64_t realisations);

  void add(const RunResult& result);
  [[nodiscard]] InstrumentStatistics statistics() const;

 private:
  struct Quantity {
    GroupedValues errors;
    MomentSums magnitudes, beyond, covered, covered_within;  ///< Of the instruments' means.
    double squared_standard_errors = 0.0;
    bool has_standard_errors = false;
  };
  void finish_instrument();
  void add_quantities();
  [[nodiscard]] std::uint64_t num_within(const std::vector<RunResult>& runs) const;

  std::vector<double> objectives_;
  std::uint64_t realisations_;
  std::vector<RunResult> runs_;  ///< Of the instrument that is not complete yet.
  InstrumentStatistics counts_;
  MomentSums within_{0.5};
  std::uint64_t num_within_always_ = 0;
  std::vector<Quantity> quantities_;
};

/// Variances between instruments and within, and shares of runs. No rows without a complete
/// instrument.
[[nodiscard]] Table variance_table(const InstrumentStatistics& statistics);
[[nodiscard]] Table instrument_table(const InstrumentStatistics& statistics);

/// The same for programs.
[[nodiscard]] nlohmann::ordered_json json_of(const InstrumentStatistics& statistics);

}  // namespace proofmass::coordinator
