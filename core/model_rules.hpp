#pragma once

#include <string_view>

#include "core/model.hpp"
#include "core/statistics/requirement.hpp"
#include "core/statistics/stop_rule.hpp"

namespace proofmass {

/// Reads a requirement or a stop rule about the quantities of the model.
[[nodiscard]] inline Requirement parse_requirement(std::string_view text) {
  return parse_requirement(text, quantity_names(model().results()));
}
[[nodiscard]] inline StopRule parse_stop_rule(std::string_view text) {
  return parse_stop_rule(text, quantity_names(model().results()));
}

}  // namespace proofmass
