#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "proto/command_line/completions.hpp"

namespace proofmass::wire {
namespace {

std::string quoted_for_fish(std::string_view text) {
  std::string result = "'";
  for (const char c : text) {
    if (c == '\\' || c == '\'') result += '\\';
    result += c;
  }
  return result + "'";
}

/// What is offered for a value: arguments of fish's `complete`.
std::string offer_for(const DescribedOption& value) {
  switch (value.kind) {
    case ValueKind::none:
      return "";
    case ValueKind::text:
      return " -x";
    case ValueKind::word: {
      // Fish expands the list once more.
      std::string words;
      for (const std::string& word : value.words) {
        if (!words.empty()) words += ' ';
        words += quoted_for_fish(word);
      }
      return fmt::format(" -x -a {}", quoted_for_fish(words));
    }
    case ValueKind::file:
      if (value.extension.empty()) return " -r -F";
      return fmt::format(" -r -k -a \"(__fish_complete_suffix {})\"",
                         quoted_for_fish(value.extension));
    case ValueKind::directory:
      return " -x -a \"(__fish_complete_directories)\"";
  }
  return "";
}

/// @param begin  `complete -c PROGRAM`, and the condition under which the options are offered.
std::string lines_of(const DescribedCommand& command, const std::string& begin) {
  std::string text;
  for (const DescribedOption& option : command.options) {
    text += begin;
    for (const std::string& name : option.names) {
      const bool is_long = name.starts_with("--");
      text += (is_long ? " -l " : " -s ") + quoted_for_fish(name.substr(is_long ? 2 : 1));
    }
    text += offer_for(option) + " -d " + quoted_for_fish(option.text) + "\n";
  }
  const auto takes_file = [](const DescribedOption& argument) {
    return argument.kind == ValueKind::file && argument.extension.empty();
  };
  if (std::ranges::none_of(command.arguments, takes_file)) text += begin + " -f\n";
  for (const DescribedOption& argument : command.arguments) {
    const std::string offer = offer_for(argument);
    const std::size_t list = offer.find(" -k -a ");
    if (list != std::string::npos) text += begin + offer.substr(list) + "\n";
    if (argument.kind == ValueKind::word) text += begin + offer.substr(3) + "\n";
  }
  return text;
}

}  // namespace

std::string fish_completion(const DescribedCommand& program) {
  const std::string begin = "complete -c " + program.name;
  std::string text = fmt::format(
      "# Completes {} in fish; made from the declarations of its options.\n", program.name);
  if (program.commands.empty()) return text + lines_of(program, begin);
  text += lines_of(program, begin + " -n __fish_use_subcommand");
  for (const DescribedCommand& command : program.commands) {
    text += fmt::format("{} -n __fish_use_subcommand -f -a {} -d {}\n", begin,
                        quoted_for_fish(command.name), quoted_for_fish(command.text));
  }
  for (const DescribedCommand& command : program.commands) {
    text += lines_of(command, fmt::format("{} -n {}", begin,
                                          quoted_for_fish("__fish_seen_subcommand_from " +
                                                          quoted_for_fish(command.name))));
  }
  return text;
}

}  // namespace proofmass::wire
