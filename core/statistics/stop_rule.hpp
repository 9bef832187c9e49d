#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/campaign/parameter.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/value_passes.hpp"

namespace proofmass {

/// Stops a campaign once a statistic of |estimate − truth| is known well enough.
struct StopRule {
  enum class Statistic { mean, standard_deviation, percentile };

  Statistic statistic = Statistic::standard_deviation;
  double level = 0.0;  ///< For `percentile`, in (0, 1); else 0.
  Parameter parameter = Parameter::a_c13;
  double relative_half_width = 0.0;  ///< Of the 95 % interval, to be reached; in (0, 1).
};

/// Reads `std(a_c13) within 5%`; the statistic is `mean`, `std` or a percentile `p1` to `p99`.
/// @throws ConfigError such as `until = max(k2c) within 5% (max is no statistic; ...)`.
[[nodiscard]] StopRule parse_stop_rule(std::string_view text);

/// The first run count ≥ 1 that a stop rule is evaluated at, above `num_runs`: 128, 192, 256, 384,
/// 512, 768 and so on, 2ᵏ and 3·2ᵏ⁻¹, whole batches all of them. Fixed counts make the stopping
/// point independent of the order in which runs finish; few of them keep the intervals honest, as
/// each look is one more chance to stop early by luck.
[[nodiscard]] std::uint64_t next_stop_check(std::uint64_t num_runs);

/// A stop rule against the runs [0, n), n being a count of next_stop_check() and all n finished.
struct StopCheck {
  bool is_reached = false;
  double estimate = 0.0;             ///< Of the statistic, SI; 0 without errors.
  std::optional<Interval> interval;  ///< Its 95 % interval; empty if errors are too few.
  /// Half the width of the interval over the estimate; empty without an interval, or if it is one
  /// about 0.
  std::optional<double> relative_half_width;
};

/// A pure function of its arguments. The intervals are mean_interval(),
/// bootstrap_deviation_interval() and percentile_interval(). A statistic that is exactly 0 with
/// an interval of no width is known.
///
/// @param errors  |estimate − truth| of the rule's parameter, SI, in run order, of the runs among
/// those that have an estimate.
/// @throws InvalidArgument if an error is not finite.
[[nodiscard]] StopCheck check_stop_rule(const StopRule& rule, std::span<const double> errors);

/// The same of errors that were seen in passes.
/// @param errors  Made for wanted_by(rule); no further pass is needed.
[[nodiscard]] StopCheck check_stop_rule(const StopRule& rule, const ValuePasses& errors);
[[nodiscard]] ValuePasses::Wanted wanted_by(const StopRule& rule);

}  // namespace proofmass
