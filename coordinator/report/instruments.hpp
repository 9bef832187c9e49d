#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <vector>

#include "coordinator/report/run_groups.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/run_result.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/variance_components.hpp"

namespace proofmass::coordinator {

/// A share of runs, with the instrument as the unit of its interval.
struct GroupedShare {
  double share = 0.0;
  Interval interval;
};

/// Whether standard errors are honest over instruments and within each of them. A run without an
/// estimate is not covered.
struct GroupedStandardErrors {
  std::optional<double> within_ratio;  ///< Variance within instruments over the mean of σ².
  GroupedShare covered;  ///< |error| within normal_95 σ: 95 % if σ is honest over all.
  /// Of n runs of an instrument with an estimate |error − their mean|·√(n/(n − 1)) within normal_95
  /// σ: 95 % if σ is all noise, and more the more of it is the instrument's.
  GroupedShare covered_within;
};

/// One quantity in all instruments.
struct InstrumentQuantity {
  OneWayAnalysis error;         ///< Of the instruments all of whose runs have an estimate.
  double mean_magnitude = 0.0;  ///< Of |error|, over the same ones.
  std::optional<Interval> magnitude_interval = {};
  /// Of the runs whose |error| is above the objective, and of those without an estimate.
  GroupedShare beyond;
  std::optional<GroupedStandardErrors> standard_errors = {};
};

/// What several realisations of the noise for each instrument tell. Shares are over all runs of the
/// instruments that are counted.
struct InstrumentStatistics {
  std::uint64_t realisations = 0;
  std::uint64_t num_instruments = 0;           ///< All of whose runs are finished or given up.
  std::uint64_t num_incomplete = 0;            ///< Of which a run is not finished yet: left out.
  std::uint64_t num_not_estimated = 0;         ///< With a run that has no estimate.
  std::vector<InstrumentQuantity> quantities;  ///< Empty without an instrument.
  // All objectives hold, in the three interpretations of ECSS-E-ST-60-10C.
  GroupedShare mixed;          ///< Of all runs.
  GroupedShare ensemble;       ///< Of the instruments: in each of their realisations.
  std::uint64_t temporal = 0;  ///< Realisations of the instrument in which they hold least often.
  std::uint64_t num_temporal = 0;         ///< Instruments in which they hold that often.
  std::uint64_t temporal_instrument = 0;  ///< The first of them.
};

/// Computes them from results in run order. Memory is fixed. A run that was given up is to be added
/// as a lost one.
class RunningInstruments {
 public:
  /// @param objectives    Of each quantity, SI.
  /// @param realisations  At least 2.
  RunningInstruments(const ResultSchema& schema, std::vector<double> objectives,
                     std::uint64_t realisations);

  void add(const RunResult& result);
  /// @pre Every result was added; to be called once.
  [[nodiscard]] InstrumentStatistics statistics();

 private:
  struct Quantity {
    GroupedValues errors;
    MomentSums magnitudes{0.0};  ///< Of the instruments' means.
    GroupedHits beyond, covered, covered_within;
    std::optional<std::size_t> position = {};  ///< Of its standard error, if it has one.
    double squared_standard_errors = 0.0;      ///< Sum over the runs in `errors`.
  };
  using Runs = std::span<const RunResult>;  // Of an instrument.
  void add_objectives(Runs runs);
  void add_shares(Runs runs, std::size_t i);
  void add_values(Runs runs, std::size_t i);
  [[nodiscard]] InstrumentQuantity statistics_of(std::size_t i) const;

  std::vector<double> objectives_;
  RunGroups groups_;
  InstrumentStatistics counts_;
  GroupedHits within_;
  std::uint64_t num_within_always_ = 0;
  bool have_standard_errors_ = false;
  std::vector<Quantity> quantities_;
};

/// Variances between instruments and within; says so if there is no complete instrument.
[[nodiscard]] Table variance_table(const ResultSchema& schema,
                                   const InstrumentStatistics& statistics);

/// Biases, and shares of runs. No rows without a complete instrument.
[[nodiscard]] Table instrument_table(const ResultSchema& schema,
                                     const InstrumentStatistics& statistics);

/// All of it for programs.
[[nodiscard]] nlohmann::ordered_json json_of(const ResultSchema& schema,
                                             const InstrumentStatistics& statistics);

}  // namespace proofmass::coordinator
