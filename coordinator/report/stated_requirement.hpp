#pragma once

#include <string>

namespace proofmass::coordinator {

/// A requirement as a document of a project states it.
struct StatedRequirement {
  std::string id;            ///< Of the project: `SYS-REQ-012`.
  std::string text;          ///< What it says in words; may be empty.
  std::string requirement;   ///< What is to be shown, see parse_requirement().
  bool is_numbered = false;  ///< Its id is no project's, but its place in the command line.
  bool is_default = false;   ///< Nobody stated it: an objective of the campaign, or all together.
};

}  // namespace proofmass::coordinator
