#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/campaign/parameter.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/tolerance.hpp"

namespace proofmass {

/// "|estimate − truth| of the parameter is below the limit in at least `coverage` of all cases",
/// to be shown with a confidence.
struct Requirement {
  Parameter parameter = Parameter::a_c12;
  double limit = 0.0;  ///< SI, > 0; an error on the limit exceeds it.
  Tolerance tolerance;
};

/// Reads `a_c12 < 9e-4 for 99% with 95%`; the limit is in SI units.
/// @throws ConfigError such as `requirement = a_c14 < 1 for 9% with 9% (a_c14 is no parameter;
/// ...)`.
[[nodiscard]] Requirement parse_requirement(std::string_view text);

enum class Verdict {
  met,        ///< The requirement holds, with the confidence asked for.
  not_met,    ///< It does not hold, with the same confidence.
  undecided,  ///< More draws are needed to tell.
};

struct RequirementCheck {
  Verdict verdict = Verdict::undecided;
  std::uint64_t num_runs = 0;              ///< Runs with and without an error.
  std::uint64_t num_exceedances = 0;       ///< Errors at or above the limit, and runs without one.
  std::uint64_t num_without_estimate = 0;  ///< Those runs.
  std::uint64_t num_allowed = 0;           ///< Exceedances with which so many runs would meet it.
  /// With this confidence at least `coverage` of all errors are below it; empty if runs are too
  /// few. The requirement is met if and only if it is below the limit.
  std::optional<ToleranceBound> bound;
  /// Of the probability of an exceedance; two-sided, exact; empty without runs.
  std::optional<Interval> exceedance;
  /// If undecided: all runs it takes to meet the requirement if none of the further ones exceeds.
  std::optional<std::uint64_t> num_runs_at_best;
  /// If undecided: all runs it takes to decide, either way, if errors go on to exceed as often as
  /// they did, one in num_runs/num_exceedances; the last of them exceeds. Empty if that is just as
  /// often as allowed, or would take more than num_runs_max.
  std::optional<std::uint64_t> num_runs_at_this_rate;
};

/// Verdict by the binomial law of the exceedances, with q = 1 − coverage and k of n exceeding: met
/// if P(Bin(n, q) ≤ k) ≤ 1 − confidence, not met if P(Bin(n, q) ≥ k) ≤ 1 − confidence.
///
/// @param errors                |estimate − truth| of the parameter, SI, in run order.
/// @param num_without_estimate  Runs that have no error; each counts as an exceedance.
/// @throws InvalidArgument if an error is not finite.
[[nodiscard]] RequirementCheck check_requirement(const Requirement& requirement,
                                                 std::span<const double> errors,
                                                 std::uint64_t num_without_estimate);

}  // namespace proofmass
