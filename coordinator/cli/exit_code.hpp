#pragma once

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

/// The user asked for something that makes no sense.
class UsageError : public Error {
 public:
  using Error::Error;
};

}  // namespace proofmass::coordinator
