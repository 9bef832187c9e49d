#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/report/read_results.hpp"
#include "coordinator/report/stated_requirement.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/runs.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/requirement.hpp"

namespace proofmass::coordinator {

/// `met`, `not met` or `undecided`.
[[nodiscard]] std::string_view name_of(RequirementVerdict verdict);

/// A fraction as it was asked for: 0.999999 is `99.9999 %`, not 100 %.
[[nodiscard]] std::string given_percent(double fraction);

/// `91.5 to 99.4 %`: both ends of an interval of a probability, to three digits or as many decimals
/// as keep 99.9996 % from being 100 %.
[[nodiscard]] std::string interval_percent(const Interval& interval);

/// The bound that a verdict was made by: `at most 0.9969 % of all draws, with 95 %` or `at least
/// ...`; both if there is none. A bound has as many digits as it takes to see on which side of the
/// limit it lies. It is of the probability of an exceedance, and for all objectives of the
/// probability that they hold.
/// @param exceedance  Bounds of the probability of an exceedance, each one-sided.
[[nodiscard]] std::string bounds_text(const Requirement& requirement, const Interval& exceedance,
                                      RequirementVerdict verdict);

/// Largest |error| of a result with an estimate beside its objective.
[[nodiscard]] double largest_ratio(const RunResult& result, std::span<const double> objectives);

/// Counts the runs that exceed what is required.
class Exceedances {
 public:
  /// @param objectives  Largest acceptable |error| of each quantity, SI.
  /// @param budget      For requirements about it.
  Exceedances(const Requirement& requirement, std::span<const double> objectives,
              const std::optional<ErrorBudget>& budget = std::nullopt)
      : requirement_(requirement),
        objectives_(objectives.begin(), objectives.end()),
        budget_(budget) {}

  /// Counts a result that has an estimate; others are not to be added.
  /// @return What is compared with RequirementAnswer::limit: an |error|, the total of the budget or
  ///         a term of it; of all objectives the largest ratio of an |error| to its objective.
  double add(const RunResult& result);

  /// Of so many runs; those that were not counted have no estimate and count as exceedances.
  /// @throws InvalidArgument if more were counted.
  [[nodiscard]] ExceedanceCount of(std::uint64_t num_runs) const;

 private:
  [[nodiscard]] double value_of(const RunResult& result) const;

  Requirement requirement_;
  std::vector<double> objectives_;
  std::optional<ErrorBudget> budget_;
  std::uint64_t num_estimated_ = 0;
  std::uint64_t num_exceeding_ = 0;
};

/// A run, and how far it is off.
struct RunValue {
  RunIndex run;
  double value = 0.0;
};

/// A requirement as somebody stated it, and what the results of a campaign say about it: a row of
/// the verification matrix.
struct RequirementAnswer {
  StatedRequirement stated;
  Requirement requirement;
  Quantity subject;  ///< What it is about, see requirement_subject(); unless is_joint().
  RequirementCheck check;
  std::uint64_t num_left_out = 0;  ///< JudgedRuns::num_left_out.
  MissingEstimates missing;        ///< The exceedances for want of an estimate.
  /// What all runs have, where a number that was fixed decided before the last of them: its verdict
  /// stands, whatever follows. There is no bound then.
  std::optional<ExceedanceCount> of_all;
  /// Upper tolerance bound of the |error| or of that ratio by order statistics: with the confidence
  /// of the requirement, `coverage` of all draws do not exceed it. Empty if draws are too few.
  std::optional<double> bound;
  bool is_of_error = false;       ///< About the |error| of a parameter, not a budget or all.
  std::optional<RunValue> worst;  ///< In the unit of the limit; empty if no run has an estimate.
  /// Of one about the budget, what not every run tells: `Γ_res = 1e-12 m/s²`. Empty if all do.
  std::string assumption = {};

  [[nodiscard]] bool is_joint() const {
    return requirement.subject == Requirement::Subject::all_objectives;
  }
  [[nodiscard]] bool is_of_budget() const { return !is_joint() && !is_of_error; }
  /// The largest |error| that is admitted, SI; of all objectives together it is 1, the largest
  /// ratio of an |error| to its objective.
  [[nodiscard]] double limit() const { return is_joint() ? 1.0 : requirement.limit; }
  /// 1 − bound / limit.
  [[nodiscard]] std::optional<double> relative_margin() const;
  /// Of the probability that a draw exceeds, by all runs: two-sided, 95 %. @pre of_all
  [[nodiscard]] Interval exceedance_of_all() const;
  /// True if that interval lies on the other side of what is allowed than the verdict.
  [[nodiscard]] bool is_opposed() const;
};

/// What the verdict rests on: `299 draws, a number fixed before the first result` or `sequential:
/// holds however often one looks and goes on`.
[[nodiscard]] std::string rule_text(const RequirementAnswer& answer);

/// What all runs have, and whether they speak against the verdict of the first: `58 of all 800
/// runs; 5.55 to 9.27 % of all draws, with 95 %`. @pre answer.of_all
[[nodiscard]] std::string text_of_all(const RequirementAnswer& answer);

/// Answer, what it rests on, the bound by which it was decided, the tolerance bound, and the draws
/// it takes; lines of at most 80 characters unless the requirement is longer.
[[nodiscard]] std::string requirement_text(const RequirementAnswer& answer,
                                           Paint paint = Paint::no);

[[nodiscard]] Tone tone_of(RequirementVerdict verdict);

/// What is asked where nobody says what a requirement demands: each objective in 95 % of all draws,
/// shown with 90 % confidence.
inline constexpr Tolerance default_tolerance{.coverage = 0.95, .confidence = 0.90};

/// Requirements that were given without ids: R1, R2 ...
[[nodiscard]] std::vector<StatedRequirement> numbered_requirements(
    std::span<const std::string> requirements);

/// What the rows of a matrix are about: these, or each objective with the default tolerance if
/// there are none, and then all objectives together unless that is asked for or no objective is
/// finite.
/// @throws ConfigError as parse_requirement().
[[nodiscard]] std::vector<StatedRequirement> matrix_requirements(
    const ResultSchema& schema, std::vector<StatedRequirement> stated,
    std::span<const double> objectives);

/// Answers requirements from results that are seen once, and then from the errors of one parameter
/// after the other. Memory is 8 bytes a run for each requirement about the budget, and for all
/// objectives together.
class VerificationMatrix {
 public:
  /// @param stated        Their order is that of the answers.
  /// @param objectives    Of the campaign, SI.
  /// @param judged        Those given up count as exceedances.
  /// @param num_fixed     As for decide().
  /// @param budget        Of the campaign, for requirements about it.
  /// @throws ConfigError as parse_requirement().
  VerificationMatrix(const ResultSchema& schema, std::vector<StatedRequirement> stated,
                     std::span<const double> objectives, const JudgedRuns& judged,
                     std::optional<std::uint64_t> num_fixed,
                     const std::optional<ErrorBudget>& budget = std::nullopt);

  /// @param result  Its numbers are in range. Results come in run order, also those that are not
  ///                judged.
  void add(const RunResult& result);
  /// To be called after all results, for each parameter that a requirement is about.
  /// @param magnitudes  |error| of all completed runs, SI, ascending; at least one.
  void add_magnitudes(std::size_t parameter, std::span<const double> magnitudes);

  [[nodiscard]] std::vector<RequirementAnswer> answers();

 private:
  /// Of some of the runs.
  struct Seen {
    Exceedances exceedances;
    std::optional<RunValue> worst = {};
  };

  struct Row {
    RequirementAnswer answer;
    Seen of_all;
    std::optional<Seen> of_fixed = {};  ///< Of the first num_fixed runs, if there are more.
    /// Of the judged runs that have an estimate; none of a parameter if these are all runs.
    std::vector<double> values = {};

    /// @param ascending  All values of the runs that have an estimate.
    void set_bound(std::span<const double> ascending);
  };

  void end_results();
  void keep_fixed_verdict(Row& row) const;

  [[nodiscard]] bool keeps_values(const Row& row) const {
    return !row.answer.is_of_error || judged_.num_left_out > 0;
  }

  JudgedRuns judged_;
  std::optional<std::uint64_t> num_fixed_;
  std::optional<ErrorBudget> budget_;
  std::string assumed_level_;
  std::vector<Row> rows_;
  MissingEstimates missing_, missing_of_fixed_;
  std::uint64_t num_runs_ = 0;
  bool have_results_ended_ = false;
};

}  // namespace proofmass::coordinator
