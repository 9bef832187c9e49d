#pragma once

#include <string>
#include <string_view>

#include "core/microscope/environment/environment_table.hpp"

namespace proofmass::detail {

/// Rows of an environment file, checked for an orbit of that period.
///
/// @param name  For messages: path of the file that has the text.
/// @throws DefinitionError naming file, line and reason.
[[nodiscard]] EnvironmentTable parse_environment(std::string_view text, const std::string& name,
                                                 double orbit_period_s);

}  // namespace proofmass::detail
