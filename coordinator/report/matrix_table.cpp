#include <fmt/format.h>

#include <algorithm>

#include "coordinator/charts/ticks.hpp"
#include "coordinator/report/review_tables.hpp"

namespace proofmass::coordinator {
namespace {

Cell count_cell(std::uint64_t count) { return {std::to_string(count), static_cast<double>(count)}; }

/// `|error| of a_c12`, or the budget or a term of it.
std::string subject_of(const RequirementAnswer& row) {
  if (row.is_joint()) return "all objectives";
  const std::string symbol(row.subject.symbol);
  return row.is_of_error ? "|error| of " + symbol : symbol;
}

/// In the unit of the tables; a ratio to the objectives without one.
Cell value_cell(const RequirementAnswer& row, const std::optional<double>& value) {
  if (!value) return "none";
  return {
      row.is_joint() ? figure_text(*value) + " × objective" : quantity_text(*value, row.subject),
      *value};
}

Cell margin_cell(const RequirementAnswer& row) {
  const std::optional<double> margin = row.relative_margin();
  if (!margin) return "none";
  return {figure_text(100.0 * *margin) + " %", *margin};
}

/// `|error| of a_c12, for 95 % with 90 %`, after the words of the project.
std::string statement_of(const RequirementAnswer& row) {
  const Tolerance& tolerance = row.requirement.tolerance;
  const std::string text =
      fmt::format("{}, for {} with {}", subject_of(row), given_percent(tolerance.coverage),
                  given_percent(tolerance.confidence));
  return row.stated.text.empty() || is_default(row) ? text
                                                    : fmt::format("{} ({})", row.stated.text, text);
}

Row matrix_cells(const RequirementAnswer& row) {
  const RequirementCheck& check = row.check;
  return {requirement_name(row),
          statement_of(row),
          value_cell(row, row.limit),
          count_cell(check.num_runs),
          count_cell(check.num_without_estimate),
          count_cell(check.num_exceedances),
          check.bound_order > 0 ? count_cell(check.bound_order - 1) : Cell("none"),
          value_cell(row, row.bound),
          margin_cell(row),
          {name_of(check.verdict), tone_of(check.verdict)},
          value_cell(row, row.worst ? std::optional(row.worst->value) : std::nullopt),
          row.worst ? count_cell(row.worst->run.value) : Cell("none")};
}

std::string_view draw_sentence(Interpretation interpretation) {
  if (interpretation == Interpretation::ensemble) {
    return "Draws are without noise, and probabilities are over instruments.";
  }
  return interpretation == Interpretation::temporal
             ? "All draws are of one instrument; probabilities are over realisations of the noise."
             : "Each draw is one instrument with one realisation of the noise, and probabilities "
               "are over both together.";
}

std::vector<std::string> matrix_notes(const Review& review) {
  std::vector<std::string> notes{
      fmt::format("Statistical interpretation in the terms of ECSS-E-ST-60-10C: {}. {}",
                  name_of(review.interpretation), draw_sentence(review.interpretation)),
      "Verdicts: " +
          (review.matrix.empty() ? std::string("none") : rule_text(review.matrix.front())) +
          ". With the confidence c of a row a requirement that does not hold is called met with "
          "probability 1 − c at most, the consumer's risk; so is one that holds called not met. "
          "The producer's risk, that one that holds is not called met, is the smaller the better "
          "it holds and the more draws there are.",
      "A draw without an estimate counts as an exceedance. Allowed are the exceedances with which "
      "so many draws meet the requirement.",
      "Bound: with the confidence of the row, the stated part of all draws stays below it (order "
      "statistics, any law). Margin: (limit − bound) / limit."};
  if (std::ranges::any_of(review.matrix, &RequirementAnswer::is_joint)) {
    notes.emplace_back(
        "All objectives together: limit and bound are of the largest ratio of an |error| to its "
        "objective in a draw.");
  }
  if (std::ranges::any_of(review.matrix, is_default)) {
    notes.push_back(fmt::format(
        "Rows made of the objectives of the campaign ask for {} of all draws with {} confidence, "
        "which is the default of the program and not a demand of a project.",
        given_percent(default_tolerance.coverage), given_percent(default_tolerance.confidence)));
  }
  return notes;
}

}  // namespace

bool is_default(const RequirementAnswer& row) {
  return row.stated.text.starts_with("Objective of ") ||
         row.stated.text == joint_requirement().text;
}

std::string requirement_name(const RequirementAnswer& row) {
  return is_default(row) && !row.is_joint() ? std::string(row.subject.symbol) : row.stated.id;
}

Table matrix_table(const Review& review) {
  Table table{.id = "matrix",
              .caption = fmt::format("Verification matrix (statistical interpretation: {})",
                                     name_of(review.interpretation)),
              .columns = {{"id", true},
                          {"requirement", true},
                          {"limit"},
                          {"draws"},
                          {"without estimate"},
                          {"exceedances"},
                          {"allowed"},
                          {"bound"},
                          {"margin"},
                          {"verdict", true},
                          {"worst value"},
                          {"in run"}},
              .notes = matrix_notes(review)};
  if (!review.why_not_independent.empty()) {
    table.notes = {fmt::format("No verdicts: {}.", review.why_not_independent)};
    return table;
  }
  for (const RequirementAnswer& row : review.matrix) table.rows.push_back(matrix_cells(row));
  return table;
}

}  // namespace proofmass::coordinator
