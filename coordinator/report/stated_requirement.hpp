#pragma once

#include <string>

namespace proofmass::coordinator {

/// A requirement as a document of a project states it.
struct StatedRequirement {
  std::string id;           ///< Of the project: `SYS-REQ-012`.
  std::string text;         ///< What it says in words; may be empty.
  std::string requirement;  ///< What is to be shown, see parse_requirement().
};

}  // namespace proofmass::coordinator
