#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/statistics/interval.hpp"
#include "core/statistics/tolerance.hpp"

namespace proofmass {

/// "In at least `coverage` of all cases |estimate − truth| of the parameter is below the limit", or
/// "all parameters meet their objectives", to be shown with a confidence.
struct Requirement {
  enum class Subject {
    parameter,       ///< One parameter against a limit.
    all_objectives,  ///< Every parameter of a run against its objective.
  };

  std::size_t parameter = 0;  ///< For Subject::parameter: its position among the names.
  double limit = 0.0;         ///< For Subject::parameter: SI, > 0; an error on it exceeds it.
  Tolerance tolerance;
  Subject subject = Subject::parameter;
};

/// Reads `a_c12 < 9e-4 for 99% with 95%`, the limit in SI units, or
/// `all objectives for 95% with 90%`.
/// @param parameters  Their names.
/// @throws ConfigError such as `requirement = a_c14 < 1 for 9% with 9% (a_c14 is no parameter;
/// ...)`.
[[nodiscard]] Requirement parse_requirement(std::string_view text,
                                            std::span<const std::string_view> parameters);

/// True if a run with these errors does not do what is required: |error| of the parameter is at or
/// above the limit, or of any parameter above its objective.
/// @param errors      estimate − truth, SI.
/// @param objectives  Largest acceptable |error| of each parameter, SI; as many.
[[nodiscard]] bool exceeds(const Requirement& requirement, std::span<const double> errors,
                           std::span<const double> objectives);

/// How many runs there are, and how many of them exceed what is required.
struct ExceedanceCount {
  std::uint64_t num_runs = 0;              ///< With and without an estimate.
  std::uint64_t num_exceedances = 0;       ///< Those that exceed it or lack an estimate.
  std::uint64_t num_without_estimate = 0;  ///< The latter.
};

enum class Verdict {
  met,        ///< The requirement holds, with the confidence asked for.
  not_met,    ///< It does not hold, with the same confidence.
  undecided,  ///< More draws are needed to tell.
};

struct RequirementCheck {
  Verdict verdict = Verdict::undecided;
  bool is_of_fixed_size = false;  ///< By the binomial law, else sequential; see decide().
  std::uint64_t num_runs = 0;     ///< As in ExceedanceCount; so are the next two.
  std::uint64_t num_exceedances = 0;
  std::uint64_t num_without_estimate = 0;
  std::uint64_t num_allowed = 0;  ///< Exceedances with which so many runs would meet it.
  std::uint64_t bound_order = 0;  ///< Of `bound`, see ToleranceBound; 0 if runs are too few.
  /// With this confidence at least `coverage` of all errors are below it; empty if runs are too
  /// few, and for all objectives. The requirement is met if and only if it is below the limit.
  std::optional<ToleranceBound> bound;
  std::optional<Interval> exceedance;  ///< As in Decision. Empty without runs.
  /// If undecided: see runs_to_meet().
  std::optional<std::uint64_t> num_runs_at_best;
  /// If undecided: all runs it takes to decide, either way, if errors go on to exceed as often as
  /// they did, one in num_runs/num_exceedances; the last of them exceeds. Empty if that is just as
  /// often as allowed, or would take more than num_runs_max.
  std::optional<std::uint64_t> num_runs_at_this_rate;
};

/// The verdict of decide(), with what it takes to get one.
///
/// @param errors                |estimate − truth| of the parameter, SI, in run order.
/// @param num_without_estimate  Runs that have no error; each counts as an exceedance.
/// @param num_fixed             As for decide().
/// @pre The requirement is one of a parameter.
/// @throws InvalidArgument if an error is not finite.
[[nodiscard]] RequirementCheck check_requirement(const Requirement& requirement,
                                                 std::span<const double> errors,
                                                 std::uint64_t num_without_estimate,
                                                 std::optional<std::uint64_t> num_fixed);

/// Checks a requirement by a count of exceedances; there is no bound then.
[[nodiscard]] RequirementCheck check_requirement(const Requirement& requirement,
                                                 const ExceedanceCount& count,
                                                 std::optional<std::uint64_t> num_fixed);

struct Decision {
  Verdict verdict = Verdict::undecided;
  bool is_of_fixed_size = false;
  /// Of the probability of an exceedance, each bound one-sided: the requirement is met if `upper`
  /// is 1 − coverage or less, and not met if `lower` is 1 − coverage or more. Empty without runs.
  std::optional<Interval> exceedance;
};

/// A verdict that may be asked for after any number of runs and again after more: if the
/// requirement does not hold, "met" is ever answered with probability 1 − confidence at most (the
/// consumer's risk), and if it holds, "not met" is ever answered with that probability at most.
///
/// With q = 1 − coverage and k of n exceeding, at n = num_fixed the verdict is "met" if
/// P(Bin(n, q) ≤ k) ≤ 1 − confidence and "not met" if P(Bin(n, q) ≥ k) ≤ 1 − confidence. At any
/// other n it is that of sequential_bounds(), with the rest of 1 − confidence that the one at
/// num_fixed leaves: README.md says why.
///
/// @param num_fixed  Runs that were asked for before any result was there. Empty if that is not
///                   known or was left open: then no look is one of a fixed number of runs.
[[nodiscard]] Decision decide(const Tolerance& tolerance, const ExceedanceCount& count,
                              std::optional<std::uint64_t> num_fixed);

/// All runs it takes until decide() says "met" if none of the further ones exceeds: the plan of
/// those who go on. Empty above num_runs_max.
[[nodiscard]] std::optional<std::uint64_t> runs_to_meet(const Tolerance& tolerance,
                                                        const ExceedanceCount& count,
                                                        std::optional<std::uint64_t> num_fixed);

}  // namespace proofmass
