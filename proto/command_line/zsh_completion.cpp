#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <string_view>

#include "proto/command_line/completions.hpp"

namespace proofmass::wire {
namespace {

constexpr std::string_view zsh_script = R"(#compdef {program}
# Completes {program} in zsh; made from the declarations of its options.

{function}() {{
  local curcontext=$curcontext state line
  typeset -A opt_args
{commands}  _arguments -C \
{specifications}
{by_command}}}

if [[ $funcstack[1] == {function} ]]; then
  {function} "$@"
else
  compdef {function} {program}
fi
)";

constexpr std::string_view by_command_script = R"(  case $state in
    command) _describe command commands ;;
    arguments)
      case $words[1] in
{branches}      esac ;;
  esac
)";

/// Puts a backslash before each of some characters.
std::string escaped(std::string_view text, std::string_view special) {
  std::string result;
  for (const char c : text) {
    if (special.find(c) != std::string_view::npos) result += '\\';
    result += c;
  }
  return result;
}

/// What is offered for a value: the last part of a specification of `_arguments`.
std::string action_for(const DescribedOption& value) {
  switch (value.kind) {
    case ValueKind::word: {
      std::string words;
      for (const std::string& word : value.words) {
        if (!words.empty()) words += ' ';
        words += escaped(word, "\\ :()'\"$`*?[]~#&|;<>");
      }
      return fmt::format("({})", words);
    }
    case ValueKind::file:
      if (value.extension.empty()) return "_files";
      return fmt::format("_files -g \"*{}\"", value.extension);
    case ValueKind::directory:
      return "_files -/";
    case ValueKind::none:
    case ValueKind::text:
      break;
  }
  return " ";  // Nothing but the value's name is shown.
}

std::string specification_of(const DescribedOption& option, const std::string& name) {
  std::string text = option.is_repeatable ? "*" : "";
  text += name;
  if (option.kind != ValueKind::none) text += name.starts_with("--") ? "=" : "+";
  text += fmt::format("[{}]", escaped(option.text, "\\[]"));
  if (option.kind == ValueKind::none) return text;
  return text + ":" + escaped(option.value_name, "\\:") + ":" + action_for(option);
}

std::string specification_of_argument(const DescribedOption& argument, std::size_t place) {
  const std::string position = argument.is_repeatable ? "*" : std::to_string(place);
  return fmt::format("{}:{}{}:{}", position, argument.is_required ? "" : ":",
                     escaped(argument.names.front(), "\\:"), action_for(argument));
}

/// Specifications for `_arguments`, one a line.
std::string specifications_of(const DescribedCommand& command, std::string_view indent) {
  std::vector<std::string> all;
  for (const DescribedOption& option : command.options) {
    for (const std::string& name : option.names) all.push_back(specification_of(option, name));
  }
  for (std::size_t i = 0; i < command.arguments.size(); ++i) {
    all.push_back(specification_of_argument(command.arguments[i], i + 1));
  }
  if (!command.commands.empty()) {
    all.insert(all.end(), {"1:command:->command", "*::argument:->arguments"});
  }
  std::string text;
  for (const std::string& one : all) {
    text += fmt::format("{}{}{}", text.empty() ? "" : " \\\n", indent, shell_quoted(one));
  }
  return text;
}

}  // namespace

std::string zsh_completion(const DescribedCommand& program) {
  std::string commands, branches;
  for (const DescribedCommand& command : program.commands) {
    commands +=
        fmt::format("    {}\n", shell_quoted(escaped(command.name, "\\:") + ":" + command.text));
    branches += fmt::format("        {})\n          _arguments \\\n{} ;;\n", command.name,
                            specifications_of(command, "            "));
  }
  if (!commands.empty()) commands = fmt::format("  local -a commands=(\n{}  )\n", commands);
  const std::string by_command =
      branches.empty() ? "" : fmt::format(by_command_script, fmt::arg("branches", branches));
  return fmt::format(zsh_script, fmt::arg("program", program.name),
                     fmt::arg("function", "_" + program.name), fmt::arg("commands", commands),
                     fmt::arg("specifications", specifications_of(program, "    ")),
                     fmt::arg("by_command", by_command));
}

}  // namespace proofmass::wire
