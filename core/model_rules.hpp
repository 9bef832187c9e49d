#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "core/model.hpp"
#include "core/statistics/requirement.hpp"
#include "core/statistics/stop_rule.hpp"

namespace proofmass {

/// What a requirement may be about: the quantities of the model, then its budget's total, `budget`,
/// and the terms of it.
[[nodiscard]] inline std::vector<std::string_view> requirement_subjects() {
  const ResultSchema& results = model().results();
  std::vector<std::string_view> names = quantity_names(results);
  if (results.budget_terms.empty()) return names;
  names.emplace_back("budget");
  names.insert(names.end(), results.budget_terms.begin(), results.budget_terms.end());
  return names;
}

/// The one at a position among these, with its units.
[[nodiscard]] inline Quantity requirement_subject(std::size_t position) {
  const std::vector<Quantity>& quantities = model().results().quantities;
  if (position < quantities.size()) return quantities[position];
  const std::string_view name = requirement_subjects().at(position);
  return {
      .name = name, .unit_suffix = "_m_s2", .symbol = name, .unit = "m/s²", .display_unit = "m/s²"};
}

/// Reads a requirement about these, or a stop rule about the quantities of the model.
[[nodiscard]] inline Requirement parse_requirement(std::string_view text) {
  return parse_requirement(text, requirement_subjects());
}
[[nodiscard]] inline StopRule parse_stop_rule(std::string_view text) {
  return parse_stop_rule(text, quantity_names(model().results()));
}

}  // namespace proofmass
