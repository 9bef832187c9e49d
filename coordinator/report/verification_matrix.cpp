#include "coordinator/report/verification_matrix.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace proofmass::coordinator {
namespace {

std::string default_tolerance_text() {
  return fmt::format("for {:.12g}% with {:.12g}%", 100.0 * default_tolerance.coverage,
                     100.0 * default_tolerance.confidence);
}

bool has_finite(std::span<const double> objectives) {
  return std::ranges::any_of(objectives, [](double value) { return std::isfinite(value); });
}

/// A requirement for each objective of the campaign.
std::vector<StatedRequirement> requirements_of_objectives(const ResultSchema& schema,
                                                          std::span<const double> objectives) {
  const std::vector<Quantity>& quantities = schema.quantities;
  std::vector<StatedRequirement> stated;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    if (!std::isfinite(objectives[i])) continue;
    const std::string& name = quantities[i].name;
    stated.push_back(
        {.id = name,
         .text = fmt::format("Objective of {}", quantities[i].symbol),
         // The shortest text that reads back to the same bits.
         .requirement = fmt::format("{} < {} {}", name, objectives[i], default_tolerance_text())});
  }
  return stated;
}

}  // namespace

StatedRequirement joint_requirement() {
  return {.id = "all",
          .text = "All objectives together",
          .requirement = "all objectives " + default_tolerance_text()};
}

std::vector<StatedRequirement> numbered_requirements(std::span<const std::string> requirements) {
  std::vector<StatedRequirement> stated;
  for (const std::string& requirement : requirements) {
    stated.push_back(
        {.id = fmt::format("R{}", stated.size() + 1), .text = "", .requirement = requirement});
  }
  return stated;
}

std::vector<StatedRequirement> matrix_requirements(const ResultSchema& schema,
                                                   std::vector<StatedRequirement> stated,
                                                   std::span<const double> objectives) {
  const auto is_joint = [&](const StatedRequirement& each) {
    return parse_requirement(each.requirement, schema).subject ==
           Requirement::Subject::all_objectives;
  };
  if (stated.empty()) stated = requirements_of_objectives(schema, objectives);
  if (has_finite(objectives) && std::ranges::none_of(stated, is_joint)) {
    stated.push_back(joint_requirement());
  }
  return stated;
}

VerificationMatrix::VerificationMatrix(const ResultSchema& schema,
                                       std::vector<StatedRequirement> stated,
                                       std::span<const double> objectives,
                                       std::uint64_t num_given_up,
                                       std::optional<std::uint64_t> num_fixed,
                                       const std::optional<ErrorBudget>& budget)
    : num_fixed_(num_fixed), missing_{.num_given_up = num_given_up}, num_runs_(num_given_up) {
  for (StatedRequirement& each : stated) {
    RequirementAnswer answer;
    answer.stated = std::move(each);
    answer.requirement = parse_requirement(answer.stated.requirement, schema);
    require_objective(answer.requirement, objectives, "requirement", answer.stated.requirement);
    if (!answer.is_joint()) {
      answer.subject = requirement_subject(schema, answer.requirement.parameter);
      answer.limit = answer.requirement.limit;
    }
    answer.is_of_error = !answer.is_joint() && answer.requirement.parameter < objectives.size();
    rows_.push_back(
        {.answer = answer, .exceedances = Exceedances(answer.requirement, objectives, budget)});
  }
}

void VerificationMatrix::add(const RunResult& result) {
  ++num_runs_;
  missing_.add(result);
  if (!result.is_completed()) return;
  for (Row& row : rows_) {
    const double value = row.exceedances.add(result);
    if (!row.answer.is_of_error) row.values.push_back(value);
    std::optional<RunValue>& worst = row.answer.worst;
    if (!worst || value > worst->value) worst = {.run = result.run, .value = value};
  }
}

void VerificationMatrix::end_results() {
  if (have_results_ended_) return;
  have_results_ended_ = true;
  for (Row& row : rows_) {
    row.answer.missing = missing_;
    row.answer.check =
        check_requirement(row.answer.requirement, row.exceedances.of(num_runs_), num_fixed_);
    std::ranges::sort(row.values);
    row.set_bound(std::exchange(row.values, {}));
  }
}

void VerificationMatrix::Row::set_bound(std::span<const double> ascending) {
  // Runs without an estimate are the largest errors.
  const std::uint64_t order = answer.check.bound_order, num_missing = answer.missing.total();
  if (ascending.empty() || order <= num_missing) return;
  answer.bound = ascending[static_cast<std::size_t>(ascending.size() - (order - num_missing))];
}

void VerificationMatrix::add_magnitudes(std::size_t parameter, std::span<const double> magnitudes) {
  end_results();
  for (Row& row : rows_) {
    if (row.answer.is_of_error && row.answer.requirement.parameter == parameter) {
      row.set_bound(magnitudes);
    }
  }
}

std::vector<RequirementAnswer> VerificationMatrix::answers() {
  end_results();
  std::vector<RequirementAnswer> answers;
  for (const Row& row : rows_) answers.push_back(row.answer);
  return answers;
}

}  // namespace proofmass::coordinator
