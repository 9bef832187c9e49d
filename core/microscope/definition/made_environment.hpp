#pragma once

#include <string>

#include "core/microscope/environment/environment_table.hpp"
#include "core/microscope/environment/physical_environment.hpp"

namespace proofmass {

class Document;

/// The settings of a document; what is absent is nominal. What is wrong is remembered by the
/// document.
[[nodiscard]] EnvironmentPhysics read_physics(Document& settings);

/// The environment file that has these rows, with the shortest digits that read back to the same
/// bits.
[[nodiscard]] std::string csv_text(const EnvironmentTable& table);

struct MadeEnvironment {
  EnvironmentTable table;
  std::string note;  ///< Why it may not be right, for people; empty if nothing is known.
};

/// Rows of an environment file for the sessions of a campaign, of the orbit that it has. Whether
/// the file exists that the campaign names, or another one, does not matter.
///
/// @param campaign  Without its data files.
/// @param settings  For read_physics().
/// @param session   Name of the one whose attitude and length the file is for; empty: of all.
/// @throws DefinitionError naming file, line, field, value and rule; ConfigError naming `session`
///         if there is none of that name, several attitudes and no name, or too many rows.
[[nodiscard]] MadeEnvironment made_environment(Document& campaign, Document& settings,
                                               const std::string& session);

}  // namespace proofmass
