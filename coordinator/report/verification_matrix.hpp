#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "coordinator/report/requirements.hpp"
#include "coordinator/store/store.hpp"
#include "core/statistics/requirement.hpp"

namespace proofmass::coordinator {

/// What is asked where nobody says what a requirement demands: each objective in 95 % of all draws,
/// shown with 90 % confidence.
inline constexpr Tolerance default_tolerance{.coverage = 0.95, .confidence = 0.90};

/// All objectives together, with the default tolerance.
[[nodiscard]] StatedRequirement joint_requirement();

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
  /// @param num_given_up  Runs that have no result, and count as exceedances.
  /// @param num_fixed     As for decide().
  /// @param budget        Of the campaign, for requirements about it.
  /// @throws ConfigError as parse_requirement().
  VerificationMatrix(const ResultSchema& schema, std::vector<StatedRequirement> stated,
                     std::span<const double> objectives, std::uint64_t num_given_up,
                     std::optional<std::uint64_t> num_fixed,
                     const std::optional<ErrorBudget>& budget = std::nullopt);

  /// @param result  Its numbers are in range.
  void add(const RunResult& result);
  /// To be called after all results, for each parameter that a requirement is about.
  /// @param magnitudes  |error| of all completed runs, SI, ascending; at least one.
  void add_magnitudes(std::size_t parameter, std::span<const double> magnitudes);

  [[nodiscard]] std::vector<RequirementAnswer> answers();

 private:
  struct Row {
    RequirementAnswer answer;
    Exceedances exceedances;
    std::vector<double> values = {};  ///< Of the runs that have an estimate; none of a parameter.

    /// @param ascending  All values of the runs that have an estimate.
    void set_bound(std::span<const double> ascending);
  };

  void end_results();

  std::optional<std::uint64_t> num_fixed_;
  std::vector<Row> rows_;
  MissingEstimates missing_;
  std::uint64_t num_runs_ = 0;
  bool have_results_ended_ = false;
};

}  // namespace proofmass::coordinator
