#pragma once

#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

#include "core/error.hpp"
#include "proto/model_program/model_choice.hpp"

namespace CLI {
class App;
}  // namespace CLI

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
[[nodiscard]] std::string exit_codes_text(std::initializer_list<ExitCode> further);

/// The user asked for something that makes no sense.
class UsageError : public Error {
 public:
  using Error::Error;
};

/// What is to be done once all arguments are parsed; returns an ExitCode.
using Command = std::function<int()>;

/// Parses the arguments, does the work and turns what goes wrong into a message and an exit code.
[[nodiscard]] int run_program(CLI::App& app, int argc, char** argv, const Command& work);

/// From now on SIGINT and SIGTERM, unless they are ignored, end the process at once with the words
/// and the exit code of an interruption: as long as there is nothing to be brought to an end.
void end_at_stop_signals();

/// Undoes end_at_stop_signals().
void let_stop_signals_kill();

/// Chooses the model, which is to be done first.
/// @param program  For the message.
/// @return The exit code if a program that is to simulate cannot be used, which it has said.
[[nodiscard]] std::optional<int> refused_model(int argc, char** argv, std::string_view program,
                                               wire::Broken broken);

/// All of `proofmass`, from its arguments to its exit code.
[[nodiscard]] int run_proofmass(int argc, char** argv);

/// All of `proofmass-coordinator`.
[[nodiscard]] int run_proofmass_coordinator(int argc, char** argv);

}  // namespace proofmass::coordinator
