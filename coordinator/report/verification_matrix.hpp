#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "coordinator/report/requirements.hpp"
#include "coordinator/report/result_passes.hpp"
#include "coordinator/report/stated_requirement.hpp"
#include "core/runs.hpp"
#include "core/statistics/requirement.hpp"
#include "core/statistics/value_passes.hpp"

namespace proofmass::coordinator {

/// What is asked where nobody says what a requirement demands: each objective in 95 % of all draws,
/// shown with 90 % confidence.
inline constexpr Tolerance default_tolerance{.coverage = 0.95, .confidence = 0.90};

/// A requirement for each objective of the campaign, with the default tolerance.
[[nodiscard]] std::vector<StatedRequirement> requirements_of_objectives(
    std::span<const double> objectives);

/// All objectives together, with the default tolerance.
[[nodiscard]] StatedRequirement joint_requirement();

/// Requirements that were given without ids: R1, R2 ...
[[nodiscard]] std::vector<StatedRequirement> numbered_requirements(
    std::span<const std::string> requirements);

/// What the rows of a matrix are about: these, or the objectives if there are none, and then all
/// objectives together unless that is asked for or no objective is finite.
[[nodiscard]] std::vector<StatedRequirement> matrix_requirements(
    std::vector<StatedRequirement> stated, std::span<const double> objectives);

/// The run that is the farthest off.
struct WorstRun {
  RunIndex run;
  double value = 0.0;  ///< In the unit of MatrixRow::limit.
};

/// A row of the verification matrix.
struct MatrixRow {
  StatedRequirement stated;
  RequirementAnswer answer;
  /// The largest |error| that is admitted, SI; of all objectives together it is 1, the largest
  /// ratio of an |error| to its objective. Empty if they are infinite, all of them.
  std::optional<double> limit;
  /// Upper tolerance bound of the |error| or of that ratio by order statistics: with the confidence
  /// of the requirement, `coverage` of all draws stay below. Empty if draws are too few.
  std::optional<double> bound;
  std::optional<WorstRun> worst;  ///< Empty if no run has an estimate.

  /// 1 − bound / limit.
  [[nodiscard]] std::optional<double> relative_margin() const;
};

/// Computes the rows. Memory is some 4 MB for each quantity that a requirement is about.
class MatrixPasses final : public ResultPasses {
 public:
  /// @param stated      Their order is that of the rows.
  /// @param objectives  Of the campaign, SI.
  /// @param given_up    Runs that have no result, and count as exceedances.
  /// @param num_fixed   As for decide().
  /// @param budget      Of the campaign, for requirements about it.
  /// @throws ConfigError as parse_requirement().
  MatrixPasses(std::vector<StatedRequirement> stated, std::span<const double> objectives,
               std::uint64_t num_given_up, std::optional<std::uint64_t> num_fixed,
               const std::optional<ErrorBudget>& budget = std::nullopt);

  void add(const RunResult& result) override;
  [[nodiscard]] bool end_pass() override;

  /// @pre No further pass is needed.
  [[nodiscard]] const std::vector<MatrixRow>& rows() const { return rows_; }

 private:
  /// Values that a bound is taken from, of all runs that have an estimate.
  struct Values {
    OrderSelection selection;
    bool is_done = false;
    std::optional<WorstRun> worst;
  };

  [[nodiscard]] std::size_t key_of(const Requirement& requirement) const;
  [[nodiscard]] double value_of(std::size_t key, const RunResult& result) const;
  [[nodiscard]] std::optional<std::size_t> place_of_bound(const MatrixRow& row) const;
  void end_first_pass();
  void fill_bounds();

  std::vector<double> objectives_;
  std::optional<ErrorBudget> budget_;
  std::vector<MatrixRow> rows_;
  std::vector<Exceedances> exceedances_;  ///< Of each row.
  std::map<std::size_t, Values> values_;  ///< By subject; those of the largest ratio are last.
  MissingEstimates missing_;
  std::uint64_t num_runs_ = 0;
  std::uint64_t num_estimated_ = 0;
  bool is_first_pass_ = true;
};

}  // namespace proofmass::coordinator
