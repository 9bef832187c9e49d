#pragma once

#include <cstdint>

#include "core/campaign/parameter.hpp"
#include "core/campaign/run_result.hpp"
#include "core/statistics/requirement.hpp"

namespace proofmass::coordinator {

/// Counts the runs that exceed what is required.
class Exceedances {
 public:
  /// @param objectives  Largest acceptable |error| of each parameter, SI.
  Exceedances(const Requirement& requirement, const ParameterArray& objectives)
      : requirement_(requirement), objectives_(objectives) {}

  /// Counts a result that has an estimate; others are none.
  void add(const RunResult& result);

  /// Of so many runs; those that were not counted have no estimate and count as exceedances.
  /// @throws InvalidArgument if more were counted.
  [[nodiscard]] ExceedanceCount of(std::uint64_t num_runs) const;

 private:
  Requirement requirement_;
  ParameterArray objectives_;
  std::uint64_t num_estimated_ = 0;
  std::uint64_t num_exceeding_ = 0;
};

}  // namespace proofmass::coordinator
