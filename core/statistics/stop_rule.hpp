#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/statistics/interval.hpp"
#include "core/statistics/requirement.hpp"

namespace proofmass {

/// Stops a campaign once a statistic is known well enough, or once a requirement is decided.
struct StopRule {
  enum class Statistic {
    mean,                ///< Of |estimate − truth| of the parameter.
    standard_deviation,  ///< Of |estimate − truth| of the parameter.
    percentile,          ///< Of |estimate − truth| of the parameter.
    success,             ///< Probability that all objectives hold.
    verdict,             ///< Of `requirement`: met or not met.
  };

  Statistic statistic = Statistic::standard_deviation;
  double level = 0.0;                ///< For `percentile`, in (0, 1); else 0.
  std::size_t parameter = 0;         ///< Position among the names.
  double relative_half_width = 0.0;  ///< Of the 95 % interval, to be reached; in (0, 1).
  /// For `verdict`; for `success` it says what a success is.
  Requirement requirement = {};
};

/// Reads `std(a_c13) within 5%`, where the statistic is `mean`, `std` or a percentile `p1` to
/// `p99`; `all objectives within 2%`; or a requirement with the word `decided` behind it, as in
/// `a_c12 < 9e-4 for 99% with 95% decided`, see parse_requirement().
/// @param parameters  Their names.
/// @throws ConfigError such as `until = max(k2c) within 5% (max is no statistic; ...)`.
[[nodiscard]] StopRule parse_stop_rule(std::string_view text,
                                       std::span<const std::string_view> parameters);

/// What the rule is about, as it was written: `std(a_c13)` of `std(a_c13) within 5%`,
/// `all objectives`, and a rule that ends in `decided` as a whole.
/// @param text  That parse_stop_rule() can read.
[[nodiscard]] std::string_view statistic_of(std::string_view text);

/// True if the rule is one about the number of runs that exceed something, and not about errors.
[[nodiscard]] bool is_about_exceedances(const StopRule& rule);

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
  /// By is_too_skewed(): the interval is then narrow where large values happen to be missing, so
  /// that a rule about a mean or a deviation is not reached by it.
  bool is_too_skewed = false;
};

/// A pure function of its arguments. The intervals are mean_interval(), the bootstrap's and the
/// percentile's. A statistic that is exactly 0 with an interval of no width is known.
/// @param errors  |estimate − truth| of the rule's parameter, SI, in run order, of the runs among
///                those that have an estimate.
/// @pre Not is_about_exceedances(rule).
[[nodiscard]] StopCheck check_stop_rule(const StopRule& rule, std::span<const double> errors);

/// Checks a stop rule about exceedances. The estimate of `success` is the fraction of the runs
/// that meet all objectives, with its Clopper-Pearson interval. That of `verdict` is the fraction
/// that exceed, with the bounds of decide(), each one-sided and with the requirement's confidence;
/// it has no relative_half_width and is reached if there is a verdict.
/// @param num_fixed  As for decide().
/// @pre is_about_exceedances(rule).
[[nodiscard]] StopCheck check_stop_rule(const StopRule& rule, const ExceedanceCount& count,
                                        std::optional<std::uint64_t> num_fixed);

}  // namespace proofmass
