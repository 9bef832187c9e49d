#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/campaign/run_result.hpp"
#include "core/statistics/requirement.hpp"

namespace proofmass::coordinator {

/// Runs that have no estimate, by reason: statistics leave them out, and say so.
struct MissingEstimates {
  std::uint64_t num_not_finite = 0;
  std::uint64_t num_no_draw = 0;
  std::uint64_t num_lost = 0;
  std::uint64_t num_given_up = 0;  ///< Having crashed workers: without a result.

  /// Counts a result if it has no estimate.
  void add(const RunResult& result);
  [[nodiscard]] std::uint64_t total() const;

  bool operator==(const MissingEstimates&) const = default;
};

/// `2 not finite, 1 without draw`, at most 76 characters; empty if there are none.
[[nodiscard]] std::string reasons_text(const MissingEstimates& missing);

/// Counts the runs that exceed what is required.
class Exceedances {
 public:
  /// @param objectives  Largest acceptable |error| of each quantity, SI.
  Exceedances(const Requirement& requirement, std::span<const double> objectives)
      : requirement_(requirement), objectives_(objectives.begin(), objectives.end()) {}

  /// Counts a result that has an estimate; others are none.
  void add(const RunResult& result);

  /// Of so many runs; those that were not counted have no estimate and count as exceedances.
  /// @throws InvalidArgument if more were counted.
  [[nodiscard]] ExceedanceCount of(std::uint64_t num_runs) const;

 private:
  Requirement requirement_;
  std::vector<double> objectives_;
  std::uint64_t num_estimated_ = 0;
  std::uint64_t num_exceeding_ = 0;
};

}  // namespace proofmass::coordinator
