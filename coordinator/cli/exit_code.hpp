#pragma once

#include <algorithm>
#include <initializer_list>
#include <string>

#include "core/error.hpp"

namespace proofmass::coordinator {

/// How the programs end; documented in their --help.
enum ExitCode : int {
  exit_done = 0,
  exit_cannot_be_done = 1,  ///< Disk, database, address, workers that crash, time limits.
  exit_wrong_usage = 2,     ///< Arguments, campaign file or query.
  exit_not_met = 3,         ///< A requirement is not met or undecided, a stop rule not reached.
  exit_interrupted = 130,   ///< SIGINT or SIGTERM; what is stored stands.
};

/// The end of `--help`.
/// @param further  What the command may end with beside 0, 1 and 2.
[[nodiscard]] inline std::string exit_codes_text(std::initializer_list<ExitCode> further) {
  const auto may_be = [&](ExitCode code) { return std::ranges::count(further, code) > 0; };
  std::string text =
      "Exit codes:\n"
      "  0    done\n"
      "  1    cannot be done: disk, database, address, workers that crash, time limit\n"
      "  2    wrong usage, campaign file or query";
  if (may_be(exit_not_met)) text += "\n  3    a requirement or stop rule is not met";
  if (may_be(exit_interrupted)) {
    text += "\n  130  interrupted by SIGINT or SIGTERM; what is stored stands";
  }
  return text;
}

/// The user asked for something that makes no sense.
class UsageError : public Error {
 public:
  using Error::Error;
};

}  // namespace proofmass::coordinator
