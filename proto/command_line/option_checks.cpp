#include "proto/command_line/option_checks.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <set>
#include <string_view>

#include "core/definition/definition_text.hpp"

namespace proofmass::wire {
namespace {

// CLI11 says `name: ` before what a check says.
std::string with_equals_sign(std::string text) {
  if (const std::size_t colon = text.find(": "); colon != text.npos) text.replace(colon, 1, " =");
  return text;
}

std::string with_nearest(std::string rule, std::string_view name,
                         const std::set<std::string>& candidates) {
  const std::optional<std::string> nearest = nearest_name(name, candidates);
  return nearest ? fmt::format("{}; nearest is {}", rule, *nearest) : rule;
}

std::string refusal_of_command(const CLI::App& app, const std::string& name) {
  std::set<std::string> commands;
  for (const CLI::App* command : app.get_subcommands({})) commands.insert(command->get_name());
  return fmt::format("command = {} ({})", name,
                     with_nearest("must be one that --help lists", name, commands));
}

const CLI::App& chosen_command(const CLI::App& app) {
  const std::vector<CLI::App*> chosen = app.get_subcommands();
  return chosen.empty() ? app : *chosen.front();
}

/// `usage: proofmass query [OPTIONS] DB SQL`
std::string usage_of(const CLI::App& command) {
  std::string text = "usage:";
  if (command.get_parent() != nullptr) text += " " + command.get_parent()->get_name();
  text += " " + command.get_name() + " [OPTIONS]";
  for (const CLI::Option* option : command.get_options()) {
    if (!option->get_positional()) continue;
    const std::string& name = option->get_name(true);
    text += option->get_required() ? " " + name : " [" + name + "]";
  }
  return text;
}

/// What was taken for the arguments that a command has: `DB = 13`.
std::string arguments_taken(const CLI::App& command) {
  std::string text;
  for (const CLI::Option* option : command.get_options()) {
    if (!option->get_positional() || option->count() == 0) continue;
    text += fmt::format("{}{} = {}", text.empty() ? "" : ", ", option->get_name(true),
                        fmt::join(option->results(), " "));
  }
  return text;
}

std::string refusal_of_further(const CLI::App& app, const std::vector<std::string>& further) {
  const CLI::App& command = chosen_command(app);
  const std::string taken = arguments_taken(command);
  return fmt::format(
      "{} = {} ({}{}; {})", further.size() == 1 ? "argument" : "arguments", fmt::join(further, " "),
      taken.empty() ? "not expected" : "not expected after ", taken, usage_of(command));
}

/// @param name  Begins with a hyphen, and may have a value behind =.
std::string refusal_of_option(const CLI::App& app, const std::string& name) {
  const CLI::App& command = chosen_command(app);
  std::set<std::string> options;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& known : option->get_lnames()) options.insert("--" + known);
  }
  return fmt::format("option = {} ({})", name,
                     with_nearest("must be one that --help lists",
                                  std::string_view(name).substr(0, name.find('=')), options));
}

// What CLI11 says of arguments and option files, worded as everything else.
std::string reworded(std::string text) {
  const auto reword = [&](std::string_view begin, std::string_view end, std::string_view field,
                          std::string_view rule) {
    if (!text.starts_with(begin) || !text.ends_with(end)) return;
    const std::size_t size = text.size() - begin.size() - end.size();
    text = fmt::format("{} = {} ({})", field, text.substr(begin.size(), size), rule);
  };
  reword("INI was not able to parse ", "", "config", "is no option");
  reword("", " was not readable (missing?)", "config", "cannot be read");
  return text;
}

}  // namespace

CLI::Validator one_of(const std::vector<std::string>& words) {
  const auto check = [words](const std::string& text) {
    if (std::ranges::find(words, text) != words.end()) return std::string();
    return fmt::format("{} (must be one of {})", text, fmt::join(words, ", "));
  };
  return CLI::Validator(check, "", "one_of");
}

std::string refusal_of(const CLI::App& app, const CLI::ParseError& error) {
  const std::string text = error.what();
  if (dynamic_cast<const CLI::ValidationError*>(&error) != nullptr) return with_equals_sign(text);
  const bool needs_command = app.get_require_subcommand_min() > 0;
  if (needs_command && app.get_subcommands().empty() && app.remaining_size() > 0) {
    return refusal_of_command(app, app.remaining().front());
  }
  const bool is_missing = dynamic_cast<const CLI::RequiredError*>(&error) != nullptr;
  if (is_missing && needs_command && app.get_subcommands().empty()) {
    return "command = none (must be one that --help lists)";
  }
  if (is_missing || dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr) {
    const std::vector<std::string> unknown = app.remaining(true);
    const auto option = std::ranges::find_if(unknown, [](const std::string& argument) {
      return argument.size() > 1 && argument.starts_with('-');
    });
    if (option != unknown.end()) return refusal_of_option(app, *option);
    if (!unknown.empty()) return refusal_of_further(app, unknown);
  }
  if (is_missing && !text.starts_with('-') && !app.get_subcommands().empty()) {
    return fmt::format("{}; {}", text, usage_of(chosen_command(app)));
  }
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr && text.ends_with(" missing")) {
    return fmt::format("option = {} (needs a value behind it)", text.substr(0, text.find(':')));
  }
  return reworded(text);
}

}  // namespace proofmass::wire
