#pragma once

#include <nlohmann/json.hpp>

#include "coordinator/cli/standard_output.hpp"

namespace proofmass::coordinator {

/// Prints an object as JSON; bytes that are no UTF-8 become U+FFFD.
/// @throws Error as print_lines().
inline void print_json(const nlohmann::ordered_json& json) {
  constexpr int indent = 2;
  print_lines(json.dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
              "\n");
}

}  // namespace proofmass::coordinator
