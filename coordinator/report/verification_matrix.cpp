#include "coordinator/report/verification_matrix.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include "core/model.hpp"
#include "core/model_rules.hpp"

namespace proofmass::coordinator {
namespace {

/// Of the values of all objectives together; others have the position of their subject.
constexpr std::size_t key_of_joint = std::numeric_limits<std::size_t>::max();

std::string default_tolerance_text() {
  return fmt::format("for {:.12g}% with {:.12g}%", 100.0 * default_tolerance.coverage,
                     100.0 * default_tolerance.confidence);
}

bool has_finite(std::span<const double> objectives) {
  return std::ranges::any_of(objectives, [](double value) { return std::isfinite(value); });
}

bool is_joint(const StatedRequirement& stated) {
  return parse_requirement(stated.requirement).subject == Requirement::Subject::all_objectives;
}

}  // namespace

std::vector<StatedRequirement> requirements_of_objectives(std::span<const double> objectives) {
  const std::vector<Quantity>& quantities = model().results().quantities;
  std::vector<StatedRequirement> stated;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    if (!std::isfinite(objectives[i])) continue;
    const std::string_view name = quantities[i].name;
    stated.push_back(
        {.id = std::string(name),
         .text = fmt::format("Objective of {}", quantities[i].symbol),
         // The shortest text that reads back to the same bits.
         .requirement = fmt::format("{} < {} {}", name, objectives[i], default_tolerance_text())});
  }
  return stated;
}

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

std::vector<StatedRequirement> matrix_requirements(std::vector<StatedRequirement> stated,
                                                   std::span<const double> objectives) {
  if (stated.empty()) stated = requirements_of_objectives(objectives);
  if (has_finite(objectives) && std::ranges::none_of(stated, is_joint)) {
    stated.push_back(joint_requirement());
  }
  std::ranges::stable_partition(stated, std::not_fn(is_joint));
  return stated;
}

std::optional<double> MatrixRow::relative_margin() const {
  if (!limit || !bound) return std::nullopt;
  return 1.0 - *bound / *limit;
}

MatrixPasses::MatrixPasses(std::vector<StatedRequirement> stated,
                           std::span<const double> objectives, std::uint64_t num_given_up,
                           std::optional<std::uint64_t> num_fixed,
                           const std::optional<ErrorBudget>& budget)
    : objectives_(objectives.begin(), objectives.end()),
      budget_(budget),
      missing_{.num_given_up = num_given_up},
      num_runs_(num_given_up) {
  for (StatedRequirement& each : stated) {
    MatrixRow row{.stated = std::move(each), .answer = {}, .limit = {}, .bound = {}, .worst = {}};
    const Requirement requirement = parse_requirement(row.stated.requirement);
    row.answer.text = row.stated.requirement;
    row.answer.requirement = requirement;
    row.answer.num_fixed = num_fixed;
    const bool is_joint = requirement.subject == Requirement::Subject::all_objectives;
    if (!is_joint) row.limit = requirement.limit;
    if (is_joint && has_finite(objectives)) row.limit = 1.0;
    exceedances_.emplace_back(requirement, objectives, budget);
    values_.try_emplace(key_of(requirement));
    rows_.push_back(std::move(row));
  }
}

std::size_t MatrixPasses::key_of(const Requirement& requirement) const {
  const bool is_joint = requirement.subject == Requirement::Subject::all_objectives;
  return is_joint ? key_of_joint : requirement.parameter;
}

double MatrixPasses::value_of(std::size_t key, const RunResult& result) const {
  if (key != key_of_joint) return required_value(result, key, budget_);
  double largest = 0.0;
  for (std::size_t i = 0; i < objectives_.size(); ++i) {
    largest = std::max(largest, std::abs(result.error(i)) / objectives_[i]);
  }
  return largest;
}

void MatrixPasses::add(const RunResult& result) {
  if (is_first_pass_) {
    ++num_runs_;
    missing_.add(result);
    for (Exceedances& exceedances : exceedances_) exceedances.add(result);
  }
  if (!result.is_completed()) return;
  if (is_first_pass_) ++num_estimated_;
  for (auto& [key, values] : values_) {
    if (values.is_done) continue;
    const double value = value_of(key, result);
    values.selection.add(value);
    const bool is_worse = !values.worst || value > values.worst->value;
    if (is_first_pass_ && is_worse) values.worst = {.run = result.run, .value = value};
  }
}

std::optional<std::size_t> MatrixPasses::place_of_bound(const MatrixRow& row) const {
  const std::uint64_t order = row.answer.check.bound_order;
  // Runs without an estimate are the largest errors.
  const std::uint64_t num_missing = num_runs_ - num_estimated_;
  if (!row.limit || order <= num_missing) return std::nullopt;
  return static_cast<std::size_t>(num_estimated_ - (order - num_missing));
}

void MatrixPasses::end_first_pass() {
  std::map<std::size_t, std::set<std::size_t>> places;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    RequirementAnswer& answer = rows_[i].answer;
    answer.missing = missing_;
    answer.check =
        check_requirement(answer.requirement, exceedances_[i].of(num_runs_), answer.num_fixed);
    const std::size_t key = key_of(answer.requirement);
    rows_[i].worst = values_.at(key).worst;
    if (const auto place = place_of_bound(rows_[i])) places[key].insert(*place);
  }
  for (auto& [key, values] : values_) {
    values.is_done = !values.selection.end_first_pass(places[key]);
  }
}

bool MatrixPasses::end_pass() {
  if (is_first_pass_) {
    is_first_pass_ = false;
    end_first_pass();
  } else {
    for (auto& [key, values] : values_) {
      if (!values.is_done) values.is_done = !values.selection.end_pass();
    }
  }
  const bool are_all_done =
      std::ranges::all_of(values_, [](const auto& entry) { return entry.second.is_done; });
  if (are_all_done) fill_bounds();
  return !are_all_done;
}

void MatrixPasses::fill_bounds() {
  for (MatrixRow& row : rows_) {
    const std::optional<std::size_t> place = place_of_bound(row);
    if (!place) continue;
    const Requirement& requirement = row.answer.requirement;
    row.bound = values_.at(key_of(requirement)).selection.value_at(*place);
    if (requirement.subject == Requirement::Subject::all_objectives) continue;
    row.answer.check.bound =
        ToleranceBound{.value = *row.bound, .order = row.answer.check.bound_order, .index = 0};
  }
}

}  // namespace proofmass::coordinator
