#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/run_result.hpp"
#include "core/error.hpp"
#include "core/statistics/requirement.hpp"
#include "core/statistics/stop_rule.hpp"

namespace proofmass {

/// What a requirement may be about: the quantities of a campaign, then its budget's total,
/// `budget`, and the terms of it.
[[nodiscard]] inline std::vector<std::string_view> requirement_subjects(
    const ResultSchema& results) {
  std::vector<std::string_view> names = quantity_names(results);
  if (results.budget_terms.empty()) return names;
  names.emplace_back("budget");
  names.insert(names.end(), results.budget_terms.begin(), results.budget_terms.end());
  return names;
}

/// The one at a position among these, with its units.
[[nodiscard]] inline Quantity requirement_subject(const ResultSchema& results,
                                                  std::size_t position) {
  if (position < results.quantities.size()) return results.quantities[position];
  const std::string_view name = requirement_subjects(results).at(position);
  return {.name = std::string(name),
          .unit_suffix = "_m_s2",
          .symbol = name,
          .unit = "m/s²",
          .display_unit = "m/s²"};
}

/// Reads a requirement about these, or a stop rule about the quantities of a campaign.
[[nodiscard]] inline Requirement parse_requirement(std::string_view text,
                                                   const ResultSchema& results) {
  return parse_requirement(text, requirement_subjects(results));
}
[[nodiscard]] inline StopRule parse_stop_rule(std::string_view text, const ResultSchema& results) {
  return parse_stop_rule(text, quantity_names(results));
}

/// Checks a requirement that somebody states; those that are stored are what they are.
/// @param requirement  Of a stop rule about a width: without a confidence.
/// @param text  Of the requirement or of the stop rule that has it, which `field` gave.
/// @throws ConfigError if the same runs could show the contrary, too, or if it is about all
///         objectives and no parameter has one: none could be missed.
inline void require_answerable(const Requirement& requirement, std::span<const double> objectives,
                               const std::string& field, const std::string& text) {
  const double confidence = requirement.tolerance.confidence;
  if (confidence > 0.0 && confidence < 0.5) {
    throw ConfigError(field, text,
                      "its confidence must be at least 50%: with less, the same runs would show a "
                      "requirement and its contrary");
  }
  const auto is_objective = [](double objective) { return std::isfinite(objective); };
  if (requirement.subject != Requirement::Subject::all_objectives) return;
  if (std::ranges::any_of(objectives, is_objective)) return;
  throw ConfigError(field, text, "needs a parameter that has an objective, and none has");
}

}  // namespace proofmass
