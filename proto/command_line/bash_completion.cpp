#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <string_view>

#include "proto/command_line/completions.hpp"

namespace proofmass::wire {
namespace {

/// The last function completes a word. It finds out which command was given, how many arguments it
/// has so far, and whether the word is the value of an option; the other two offer words and files.
/// Bash breaks words at = and :, so that --format=csv and tcp://a:5555 are several.
constexpr std::string_view script =
    R"(# Completes {program} in bash; made from the declarations of its options.

{function}_words() {{
  local word
  for word in "${{@:2}}"; do
    [[ $word == "$1"* ]] && COMPREPLY+=("$word")
  done
}}

{function}_files() {{
  compopt -o filenames 2>/dev/null
  mapfile -t COMPREPLY < <(compgen -f -X "!*$2" -- "$1"; compgen -d -- "$1")
}}

{function}() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD - 1]}}
  COMPREPLY=()
  if [[ $current == = ]]; then
    current=
  elif [[ $previous == = ]]; then
    previous=${{COMP_WORDS[COMP_CWORD - 2]}}
  fi
  local command= position=0 is_value= word
  local valued={valued}
  for word in "${{COMP_WORDS[@]:1:COMP_CWORD - 1}}"; do
    if [[ $word == [=:]* ]]; then
      is_value=1
    elif [[ $is_value ]]; then
      is_value=
    elif [[ $word == -* ]]; then
      [[ $valued == *" $word "* ]] && is_value=1
    elif [[ -z $command && {commands} == *" $word "* ]]; then
      command=$word
      case $command in
{valued_by_command}      esac
    else
      ((++position))
    fi
  done
  if [[ $is_value ]]; then
    case "$command $previous" in
{values}    esac
  elif [[ $current == -* ]]; then
    case $command in
{options}    esac
  else
    case "$command $position" in
{arguments}    esac
  fi
}}

complete -F {function} {program}
)";

std::string quoted_list(const std::vector<std::string>& words) {
  std::string result;
  for (const std::string& word : words) result += fmt::format(" {}", shell_quoted(word));
  return result;
}

/// `' --db --set '`: names that a word is looked up in.
std::string word_set(const std::vector<std::string>& words) {
  std::string result = " ";
  for (const std::string& word : words) result += word + " ";
  return shell_quoted(result);
}

std::vector<std::string> names_of(const DescribedCommand& command) {
  std::vector<std::string> names;
  for (const DescribedOption& option : command.options) {
    names.insert(names.end(), option.names.begin(), option.names.end());
  }
  return names;
}

std::vector<std::string> names_with_value(const DescribedCommand& command) {
  std::vector<std::string> names;
  for (const DescribedOption& option : command.options) {
    if (option.kind == ValueKind::none) continue;
    names.insert(names.end(), option.names.begin(), option.names.end());
  }
  return names;
}

std::vector<std::string> names_of_commands(const DescribedCommand& program) {
  std::vector<std::string> names;
  for (const DescribedCommand& command : program.commands) names.push_back(command.name);
  return names;
}

/// Writes the branches of the script's `case` statements.
class Branches {
 public:
  explicit Branches(std::string function) : function_(std::move(function)) {}

  /// @param command  Empty for the program's own options and arguments.
  void add(const std::string& command, const DescribedCommand& described) {
    options += fmt::format("      {}) {}_words \"$current\"{} ;;\n", shell_quoted(command),
                           function_, quoted_list(names_of(described)));
    for (const DescribedOption& option : described.options) {
      for (const std::string& name : option.names) {
        add_value(values, shell_quoted(command + " " + name), option);
      }
    }
    for (std::size_t i = 0; i < described.arguments.size(); ++i) {
      const DescribedOption& argument = described.arguments[i];
      const std::string pattern = argument.is_repeatable
                                      ? shell_quoted(command + " ") + "*"
                                      : shell_quoted(fmt::format("{} {}", command, i));
      add_value(arguments, pattern, argument);
    }
  }

  std::string options;
  std::string values;
  std::string arguments;

 private:
  void add_value(std::string& branches, const std::string& pattern, const DescribedOption& value) {
    switch (value.kind) {
      case ValueKind::none:
      case ValueKind::text:
        return;
      case ValueKind::word:
        branches += fmt::format("      {}) {}_words \"$current\"{} ;;\n", pattern, function_,
                                quoted_list(value.words));
        return;
      case ValueKind::file:
        branches += fmt::format("      {}) {}_files \"$current\" {} ;;\n", pattern, function_,
                                shell_quoted(value.extension));
        return;
      case ValueKind::directory:
        // No file has a name that ends in a slash.
        branches += fmt::format("      {}) {}_files \"$current\" / ;;\n", pattern, function_);
        return;
    }
  }

  std::string function_;
};

}  // namespace

std::string shell_quoted(std::string_view text) {
  std::string result = "'";
  for (const char c : text) {
    if (c == '\'') {
      result += "'\\''";
    } else {
      result += c;
    }
  }
  return result + "'";
}

std::string bash_completion(const DescribedCommand& program) {
  std::string function = "_" + program.name;
  std::ranges::replace(function, '-', '_');
  Branches branches(function);
  branches.add("", program);
  std::string valued_by_command;
  for (const DescribedCommand& command : program.commands) {
    branches.add(command.name, command);
    valued_by_command += fmt::format("        {}) valued={} ;;\n", shell_quoted(command.name),
                                     word_set(names_with_value(command)));
  }
  if (!program.commands.empty()) {
    branches.arguments += fmt::format("      ' 0') {}_words \"$current\"{} ;;\n", function,
                                      quoted_list(names_of_commands(program)));
  }
  return fmt::format(script, fmt::arg("program", program.name), fmt::arg("function", function),
                     fmt::arg("valued", word_set(names_with_value(program))),
                     fmt::arg("commands", word_set(names_of_commands(program))),
                     fmt::arg("valued_by_command", valued_by_command),
                     fmt::arg("values", branches.values), fmt::arg("options", branches.options),
                     fmt::arg("arguments", branches.arguments));
}

}  // namespace proofmass::wire
