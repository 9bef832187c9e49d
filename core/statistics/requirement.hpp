#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/statistics/interval.hpp"

namespace proofmass {

/// "At least `coverage` of all cases, with probability `confidence`": 0.99 with 0.95.
struct Tolerance {
  double coverage = 0.0;    ///< In (0, 1).
  double confidence = 0.0;  ///< In (0, 1).

  /// @throws InvalidArgument naming the field.
  void validate() const;

  /// True if something is shown whose opposite would let this happen with probability `doubt`. A
  /// probability that is 1 − confidence by its formula is not to fail for its rounding.
  [[nodiscard]] bool is_shown(double doubt) const {
    return doubt <= (1.0 - confidence) * (1.0 + 1e-12);
  }
};

/// Largest order, 1 being that of the largest value, whose value is a one-sided tolerance bound
/// among so many runs [Wilks1941]: order − 1 runs may exceed a limit and the tolerance is shown all
/// the same. 0 if there are too few runs.
[[nodiscard]] std::uint64_t wilks_order(const Tolerance& tolerance, std::uint64_t num_runs);

/// The smallest value that is a bound, below which at least `coverage` of all cases lie; empty if
/// there are too few. Values of any law.
///
/// @param num_unknown  Runs without a value, each counted as larger than any.
/// @throws InvalidArgument if a value is not finite or the tolerance is not one.
[[nodiscard]] std::optional<double> wilks_upper(std::span<const double> values,
                                                const Tolerance& tolerance,
                                                std::uint64_t num_unknown = 0);

/// Evidence about a probability from `num_hits` events in `num_runs` runs, which may be looked at
/// after every run and as often as one likes.
///
/// Against "the probability is p or more" it is the likelihood of the runs, averaged over the
/// smaller probabilities p′, over their likelihood under p [Robbins1970]:
///
///     M = ∫₀ᵖ w(p′) (p′/p)ᵏ ((1 − p′)/(1 − p))ⁿ⁻ᵏ dp′      w(p′) = 1/(2 √(p p′))
///       = (1 − p) I_p(k + ½, n − k + 1)/(2 P(k + ½, n − k + 1; p))
///
/// with I the regularised incomplete beta function and P(a, b; p) = pᵃ(1 − p)ᵇ/B(a, b). If the
/// probability is p or more, M is a supermartingale that starts at 1: it ever reaches 1/α with
/// probability α at most [Ville1939]. This is what makes stopping at the first M ≥ 1/α sound.
///
/// @param probability  p, in (0, 1).
/// @pre 0 ≤ num_hits ≤ num_runs.
[[nodiscard]] double evidence_of_less(double num_hits, double num_runs, double probability);

/// Evidence against "the probability is p or less", with the weight of the larger ones
/// w(p′) = p′^(−3/2)/(2 (p^(−1/2) − 1)). Without a hit there is none: 1 at most; it is then 0 here.
[[nodiscard]] double evidence_of_more(double num_hits, double num_runs, double probability);

/// What the evidence leaves: with this confidence the probability is never below any lower bound
/// of the sequence of runs, and with the same confidence never above any upper one. Each bound is
/// one-sided.
///
/// @pre num_runs > 0. @throws InvalidArgument unless 0 < confidence < 1.
[[nodiscard]] Interval sequential_bounds(double num_hits, double num_runs, double confidence);

/// "In at least `coverage` of all cases |estimate − truth| of the parameter is below the limit", or
/// "all parameters meet their objectives", to be shown with a confidence.
struct Requirement {
  enum class Subject {
    parameter,       ///< One parameter against a limit.
    all_objectives,  ///< Every parameter of a run against its objective.
  };

  std::size_t parameter = 0;  ///< For Subject::parameter: its position among the names.
  double limit = 0.0;         ///< For Subject::parameter: SI, > 0.
  Tolerance tolerance;
  Subject subject = Subject::parameter;
  bool admits_limit = false;  ///< For Subject::parameter: `<=` instead of `<`.

  /// For Subject::parameter.
  [[nodiscard]] bool is_exceeded_by(double magnitude) const {
    return admits_limit ? magnitude > limit : magnitude >= limit;
  }
};

/// Begins requirements and stop rules about all objectives: no parameter may have this name.
inline constexpr std::string_view all_objectives_word = "all";

/// Reads `a_c12 < 9e-4 for 99% with 95%`, `<` or `<=` and the limit in SI units, or
/// `all objectives for 95% with 90%`.
/// @param parameters  Their names.
/// @throws ConfigError such as `requirement = a_c14 < 1 for 9% with 9% (a_c14 is no parameter;
/// ...)`.
[[nodiscard]] Requirement parse_requirement(std::string_view text,
                                            std::span<const std::string_view> parameters);

/// True if a run with these errors does not do what is required: |error| of the parameter is above
/// the limit, or of any parameter above its objective.
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

enum class RequirementVerdict {
  met,        ///< The requirement holds, with the confidence asked for.
  not_met,    ///< It does not hold, with the same confidence.
  undecided,  ///< More draws are needed to tell.
};

struct Decision {
  RequirementVerdict verdict = RequirementVerdict::undecided;
  bool is_of_fixed_size = false;  ///< By the binomial law, else sequential; see decide().
  /// Of the probability of an exceedance, each bound one-sided: the requirement is met if `upper`
  /// is 1 − coverage or less, and not met if `lower` is 1 − coverage or more. Empty without runs.
  std::optional<Interval> exceedance;
};

/// A decision about so many runs, with what it takes to get one.
struct RequirementCheck : Decision, ExceedanceCount {
  /// Order, from the largest error, of the one below which at least `coverage` of all errors are
  /// with this confidence; 0 if runs are too few. The requirement is met if and only if that error
  /// does not exceed the limit. One less are the exceedances with which so many runs meet it.
  std::uint64_t bound_order = 0;
  /// If undecided: all runs it takes until the requirement is met if none of the further ones
  /// exceeds, the plan of those who go on. Empty above num_runs_max.
  std::optional<std::uint64_t> num_runs_at_best{};
  /// If undecided: all runs it takes to decide, either way, if errors go on to exceed as often as
  /// they did, one in num_runs/num_exceedances; the last of them exceeds. Empty if that is just as
  /// often as allowed, or would take more than num_runs_max.
  std::optional<std::uint64_t> num_runs_at_this_rate{};
};

/// The verdict of decide(), with what it takes to get one.
/// @param num_fixed  As for decide().
[[nodiscard]] RequirementCheck check_requirement(const Requirement& requirement,
                                                 const ExceedanceCount& count,
                                                 std::optional<std::uint64_t> num_fixed);

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

/// RequirementCheck::num_runs_at_best, whatever the verdict is now.
[[nodiscard]] std::optional<std::uint64_t> runs_to_meet(const Tolerance& tolerance,
                                                        const ExceedanceCount& count,
                                                        std::optional<std::uint64_t> num_fixed);

}  // namespace proofmass
