#include "proto/command_line/man_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <map>
#include <string_view>

namespace proofmass::wire {
namespace {

/// Text that means nothing to roff. Names that a reader copies need the ASCII characters that roff
/// would replace by typographic ones.
std::string escaped(std::string_view text) {
  static const std::map<char, std::string_view> escapes{
      {'\\', "\\(rs"}, {'-', "\\-"},   {'\'', "\\(aq"}, {'"', "\\(dq"},
      {'`', "\\(ga"},  {'^', "\\(ha"}, {'~', "\\(ti"},  {'\n', " "}};
  // A dot at the beginning of a line would make it a request.
  std::string result = text.starts_with('.') ? "\\&" : "";
  for (const char c : text) {
    const auto escape = escapes.find(c);
    result += escape == escapes.end() ? std::string(1, c) : std::string(escape->second);
  }
  return result;
}

std::string bold(std::string_view text) { return fmt::format("\\fB{}\\fR", escaped(text)); }
std::string italic(std::string_view text) { return fmt::format("\\fI{}\\fR", escaped(text)); }

std::string comma_list(const std::vector<std::string>& texts) {
  std::string list;
  for (const std::string& text : texts) list += (list.empty() ? "" : ", ") + text;
  return list;
}

std::string as_sentence(std::string text) {
  if (!text.empty() && text.back() != '.') text += '.';
  return text;
}

/// `proofmass query [OPTIONS] DB SQL`
std::string synopsis_of(const DescribedCommand& command, std::string_view program) {
  std::string text = program.empty() ? "" : bold(program) + " ";
  text += fmt::format("{} [{}]", bold(command.name), italic("OPTIONS"));
  for (const DescribedOption& argument : command.arguments) {
    std::string name = italic(argument.names.front());
    if (argument.is_repeatable) name += " ...";
    if (!argument.is_required) name = fmt::format("[{}]", name);
    text += fmt::format(" {}", name);
  }
  if (!command.commands.empty()) text += fmt::format(" {} ...", italic("COMMAND"));
  return text + "\n";
}

std::string facts_about(const DescribedOption& option) {
  std::string text;
  if (!option.range.empty()) text += fmt::format("\nMust be in {}.", escaped(option.range));
  if (!option.default_value.empty()) {
    text += fmt::format("\nThe default is {}.", escaped(option.default_value));
  }
  if (option.is_required) text += "\nMust be given.";
  if (!option.variable.empty()) {
    text += fmt::format("\nCan come from the environment variable {}.", bold(option.variable));
  }
  return text;
}

std::string paragraph_about(const DescribedOption& option, bool is_argument) {
  std::vector<std::string> names;
  for (const std::string& name : option.names) {
    names.push_back(is_argument ? italic(name) : bold(name));
  }
  std::string head = comma_list(names);
  if (!is_argument && option.kind != ValueKind::none)
    head += fmt::format(" {}", italic(option.value_name));
  if (option.is_repeatable) head += " ...";
  return fmt::format(".TP\n{}\n{}{}\n", head, escaped(as_sentence(option.text)),
                     facts_about(option));
}

/// Commands have --help too, which is not repeated for each.
enum class HelpOption : std::uint8_t { shown, left_out };

/// Arguments and options.
std::string paragraphs_of(const DescribedCommand& command, HelpOption help) {
  std::string text;
  for (const DescribedOption& argument : command.arguments) text += paragraph_about(argument, true);
  for (const DescribedOption& option : command.options) {
    const bool is_help = std::ranges::find(option.names, "--help") != option.names.end();
    if (help == HelpOption::shown || !is_help) text += paragraph_about(option, false);
  }
  return text;
}

std::string section_of(const DescribedCommand& command, std::string_view program) {
  std::string text =
      fmt::format(".SS {}\n{}.PP\n{}\n{}", escaped(command.name), synopsis_of(command, program),
                  escaped(as_sentence(command.text)), paragraphs_of(command, HelpOption::left_out));
  std::vector<std::string> codes;
  for (const DescribedExit& exit : command.exits) codes.push_back(exit.code);
  if (!codes.empty()) text += fmt::format(".PP\nExit status: {}.\n", comma_list(codes));
  return text;
}

std::string commands_section(const DescribedCommand& program) {
  if (program.commands.empty()) return {};
  std::string text = fmt::format(".SH COMMANDS\nEach command also has {}.\n", bold("--help"));
  for (const DescribedCommand& command : program.commands) {
    text += section_of(command, program.name);
  }
  return text;
}

std::string exit_section(const DescribedCommand& program) {
  if (program.exits.empty()) return {};
  std::string text = ".SH EXIT STATUS\n";
  for (const auto& [code, meaning] : program.exits) {
    text += fmt::format(".TP\n{}\n{}\n", bold(code), escaped(as_sentence(meaning)));
  }
  return text;
}

/// Which options each variable is for.
void collect_variables(
    const DescribedCommand& command, std::string_view of,
    std::map<std::string, std::map<std::string, std::vector<std::string>>>& all) {
  for (const DescribedOption& option : command.options) {
    if (!option.variable.empty()) {
      all[option.variable][option.names.back()].emplace_back(of);
    }
  }
  for (const DescribedCommand& one : command.commands) collect_variables(one, one.name, all);
}

std::string environment_section(const DescribedCommand& program) {
  std::map<std::string, std::map<std::string, std::vector<std::string>>> all;
  collect_variables(program, "", all);
  if (all.empty()) return {};
  std::string text = fmt::format(
      ".SH ENVIRONMENT\n"
      "An option that is given on the command line or in the file of {}\n"
      "goes before its environment variable.\n",
      bold("--config"));
  for (const auto& [variable, options] : all) {
    text += ".TP\n" + bold(variable) + "\n";
    for (const auto& [option, commands] : options) {
      const std::string of = comma_list(commands);
      text +=
          fmt::format("Value of {}{}{}.\n", bold(option), of.empty() ? "" : " of ", escaped(of));
    }
  }
  return text;
}

std::string see_also_section(const std::vector<std::string>& see_also) {
  std::vector<std::string> pages;
  for (const std::string& name : see_also) pages.push_back(bold(name) + "(1)");
  if (pages.empty()) return {};
  return fmt::format(".SH SEE ALSO\n{}\n", comma_list(pages));
}

}  // namespace

std::string man_page(const DescribedCommand& program, const std::string& version,
                     const std::vector<std::string>& see_also) {
  std::string title = program.name;
  std::ranges::transform(title, title.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  const std::string purpose = program.text.substr(0, program.text.find(". "));
  return fmt::format(
      ".TH {} 1 \"\" \"{}\" \"Proofmass\"\n"
      ".nh\n.ad l\n"  // Nothing that a reader copies may be broken into two words.
      ".SH NAME\n{} \\- {}\n"
      ".SH SYNOPSIS\n{}"
      ".SH DESCRIPTION\n{}\n"
      ".SH OPTIONS\n{}{}{}{}{}",
      escaped(title), escaped(version), escaped(program.name), escaped(purpose),
      synopsis_of(program, ""), escaped(program.text), paragraphs_of(program, HelpOption::shown),
      commands_section(program), exit_section(program), environment_section(program),
      see_also_section(see_also));
}

}  // namespace proofmass::wire
