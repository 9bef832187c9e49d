#pragma once

#include <sys/wait.h>

#include <cstddef>
#include <cstdio>
#include <string>
#include <vector>

namespace proofmass::test {

/// What a command of the shell printed on both streams, and how it ended.
struct ShellAnswer {
  int exit_code = -1;
  std::string output;
};

inline ShellAnswer shell_answer(const std::string& command) {
  ShellAnswer answer;
  std::FILE* const pipe = popen(("( " + command + " ) 2>&1").c_str(), "r");
  if (pipe == nullptr) return answer;
  char buffer[4096];
  while (const std::size_t size = std::fread(buffer, 1, sizeof buffer, pipe)) {
    answer.output.append(buffer, size);
  }
  const int status = pclose(pipe);
  if (WIFEXITED(status)) answer.exit_code = WEXITSTATUS(status);
  return answer;
}

inline bool has_program(const std::string& name) {
  return shell_answer("command -v " + name).exit_code == 0;
}

/// What bash offers for the last of some words, one a line.
/// @param script  As deploy/manual.sh writes it.
/// @param words   As bash splits a command line, each in the quotes that bash needs.
inline std::string offered_by_bash(const std::string& script, const std::string& function,
                                   const std::vector<std::string>& words) {
  std::string list;
  for (const std::string& word : words) list += " " + word;
  const std::string commands =
      "source \"" + script + "\"; COMP_WORDS=(" + list +
      "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); " + function +
      "; [[ ${#COMPREPLY[@]} -eq 0 ]] || printf \"%s\\n\" \"${COMPREPLY[@]}\"";
  std::string quoted = "'";
  for (const char c : commands) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return shell_answer("bash --norc -c " + quoted + "'").output;
}

}  // namespace proofmass::test
