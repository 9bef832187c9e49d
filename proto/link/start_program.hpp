#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace proofmass::wire {

/// A program to be started as a process of its own.
struct ProgramStart {
  /// The program first: a path, or a name that is looked for in PATH.
  std::vector<std::string> arguments;
  /// That become its standard input, output and error, and further ones from 3 on.
  std::vector<int> descriptors{0, 1, 2};
  /// `NAME=value` each; that of this process by default.
  std::optional<std::vector<std::string>> environment = {};
  /// Signals of the terminal, such as that of Ctrl-C, do not reach it.
  bool has_own_group = false;
};

/// Starts the program with no signal blocked and SIGPIPE not ignored, whatever holds here.
/// @returns Its process id; the caller waits for its end.
/// @throws Error reading `PROGRAM: cannot be started: reason`.
[[nodiscard]] pid_t start_program(const ProgramStart& start);

/// The environment of this process without the variables that set options of Proofmass's programs
/// (`PROOFMASS_*`, `SLURM_JOB_END_TIME`) or name an init system: they are meant for this process,
/// or for workers elsewhere.
[[nodiscard]] std::vector<std::string> environment_without_settings();

/// Another program of Proofmass: the file of that name beside the program that runs.
/// @throws Error reading `program = PATH (rule)` if it is not there or cannot be executed.
[[nodiscard]] std::filesystem::path program_beside_this(std::string_view name);

/// The text as one word of a command line for a POSIX shell.
[[nodiscard]] std::string shell_word(std::string_view text);

}  // namespace proofmass::wire
