#include "proto/command_line/option_checks.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>

#include "core/definition/definition_text.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::wire {
namespace {

constexpr std::uint64_t seconds_max = std::uint64_t{366} * 24 * 3600;

/// Seconds in the unit; nothing if there is no such unit.
std::optional<std::uint64_t> seconds_in(std::string_view unit) {
  static const std::map<std::string_view, std::uint64_t> units{
      {"", 1}, {"s", 1}, {"m", 60}, {"h", 3600}, {"d", 86400}};
  const auto found = units.find(unit);
  return found == units.end() ? std::nullopt : std::optional(found->second);
}

std::string with_nearest(std::string rule, std::string_view name,
                         const std::set<std::string>& candidates) {
  const std::optional<std::string> nearest = nearest_name(name, candidates);
  return nearest ? fmt::format("{}; nearest is {}", rule, *nearest) : rule;
}

std::set<std::string> command_names(const CLI::App& app) {
  std::set<std::string> names;
  for (const CLI::App* command : app.get_subcommands({})) names.insert(command->get_name());
  return names;
}

/// Of the options that --help lists, each behind the hyphens.
std::set<std::string> option_names(const CLI::App& command, const std::string& hyphens) {
  std::set<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_group().empty()) continue;
    for (const std::string& name : option->get_lnames()) names.insert(hyphens + name);
  }
  return names;
}

/// Null if there is none of this name.
const CLI::App* command_of(const CLI::App& app, const std::string& name) {
  for (const CLI::App* command : app.get_subcommands({})) {
    if (command->get_name() == name) return command;
  }
  return nullptr;
}

const CLI::App& chosen_command(const CLI::App& app) {
  const std::vector<CLI::App*> chosen = app.get_subcommands();
  return chosen.empty() ? app : *chosen.front();
}

/// Where the value of an option is from: the variable that has it, or the option.
std::string source_of(const CLI::App& command, const std::string& name) {
  const CLI::Option* const option = command.get_option_no_throw(name);
  if (option == nullptr || option->get_envname().empty()) return name;
  const char* const value = std::getenv(option->get_envname().c_str());
  const bool is_from_variable =
      value != nullptr && option->results() == std::vector<std::string>{value};
  return is_from_variable ? option->get_envname() : name;
}

/// @param text  Of CLI11, which says `name: ` before what a check says.
std::string refusal_of_value(const CLI::App& app, const std::string& text) {
  const std::size_t colon = text.find(": ");
  if (colon == text.npos) return text;
  return fmt::format("{} ={}", source_of(chosen_command(app), text.substr(0, colon)),
                     text.substr(colon + 1));
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
  return fmt::format("option = {} ({})", name,
                     with_nearest("must be one that --help lists",
                                  std::string_view(name).substr(0, name.find('=')),
                                  option_names(chosen_command(app), "--")));
}

/// `FILE:3` for the line of an option file that has what CLI11 calls `query.rows`, or `query.++`
/// for the line `[query]`. FILE alone if no line is found.
std::string place_in(const std::string& file, const std::string& item) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) return file;  // A pipe is read only once.
  std::ifstream stream(file);
  std::string line, section;
  for (int number = 1; std::getline(stream, line); ++number) {
    line = without_byte_order_mark(line);
    CLI::detail::trim(line);
    std::string name = CLI::detail::trim_copy(line.substr(0, line.find_first_of("=#")));
    if (line.starts_with('[') && line.ends_with(']')) {
      section = line.substr(1, line.size() - 2) + ".";
      name = "++";
    }
    if (item == section + name) return fmt::format("{}:{}", file, number);
  }
  return file;
}

/// @param item  `query.rows`, `query.++` for a section, or what was taken for an option.
std::string rule_for_item(const CLI::App& app, const std::string& item) {
  if (item.starts_with('[')) return item + " has no ]";
  constexpr std::string_view section_end = ".++";
  if (item.ends_with(section_end)) {
    const std::string section = item.substr(0, item.size() - section_end.size());
    return with_nearest(fmt::format("[{}] is no command", section), section, command_names(app));
  }
  const std::size_t point = item.find('.');
  const CLI::App* const command =
      point == item.npos ? &app : command_of(app, item.substr(0, point));
  if (command == nullptr) return item + " is no option";
  return with_nearest(item + " is no option", item.substr(point == item.npos ? 0 : point + 1),
                      option_names(*command, ""));
}

/// What CLI11 says of an option file: that of the option `--config`.
std::string refusal_of_file(const CLI::App& app, const std::string& text) {
  constexpr std::string_view unknown = "INI was not able to parse ";
  const auto file = app.get_config_ptr()->as<std::string>();
  if (!text.starts_with(unknown)) return fmt::format("config = {} ({})", file, text);
  const std::string item = text.substr(unknown.size());
  return fmt::format("config = {} ({})", place_in(file, item), rule_for_item(app, item));
}

/// As CLI11 reads option files, which knows no byte order mark.
class OptionFile : public CLI::ConfigTOML {
 public:
  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override {
    const std::string text(std::istreambuf_iterator<char>(input), {});
    std::istringstream rest(std::string(without_byte_order_mark(text)));
    return CLI::ConfigTOML::from_config(rest);
  }
};

}  // namespace

std::optional<std::chrono::seconds> duration_from(std::string_view text) {
  std::uint64_t count = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
  const auto unit = seconds_in(text.substr(static_cast<std::size_t>(end - text.data())));
  if (error != std::errc{} || !unit || count < 1 || count > seconds_max / *unit)
    return std::nullopt;
  return std::chrono::seconds(count * *unit);
}

void refuse_options_as_values(CLI::App& app) {
  for (CLI::App* command : app.get_subcommands(nullptr)) {
    for (CLI::Option* option : command->get_options(nullptr)) {
      if (option->get_positional() || option->get_items_expected_max() == 0) continue;
      option->check([names = option_names(*command, "--")](const std::string& value) {
        return names.contains(value) ? value + " (is an option; the value must stand before it)"
                                     : "";
      });
    }
  }
}

CLI::Validator one_of(const std::vector<std::string>& words) {
  const auto check = [words](const std::string& text) {
    if (std::ranges::find(words, text) != words.end()) return std::string();
    return fmt::format("{} (must be one of {})", text, fmt::join(words, ", "));
  };
  return CLI::Validator(check, "", "one_of");
}

void add_option_file(CLI::App& app, const std::string& description, const std::string& variable) {
  // CLI11 reads the file before it looks at variables. As a required default it must be there.
  const char* const file = variable.empty() ? nullptr : std::getenv(variable.c_str());
  const bool has_file = file != nullptr && *file != '\0';
  app.set_config("--config", has_file ? file : "", description, has_file)
      ->envname(variable)
      ->type_name(file_type);
  app.allow_config_extras(CLI::config_extras_mode::error);
  app.config_formatter(std::make_shared<OptionFile>());
}

std::string refusal_of(const CLI::App& app, const CLI::ParseError& error) {
  const std::string text = error.what();
  if (dynamic_cast<const CLI::ValidationError*>(&error) != nullptr)
    return refusal_of_value(app, text);
  const bool needs_command = app.get_require_subcommand_min() > 0;
  if (needs_command && app.get_subcommands().empty() && app.remaining_size() > 0) {
    const std::string name = app.remaining().front();
    return fmt::format("command = {} ({})", name,
                       with_nearest("must be one that --help lists", name, command_names(app)));
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
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) {
    const std::string name = text.substr(0, text.find(':'));
    if (text.ends_with(" missing"))
      return fmt::format("option = {} (needs a value behind it)", name);
    if (text.find(": At Most 1 ") != text.npos) {
      return fmt::format("option = {} (must be given once)", name);
    }
  }
  if (dynamic_cast<const CLI::ConfigError*>(&error) != nullptr) return refusal_of_file(app, text);
  if (dynamic_cast<const CLI::FileError*>(&error) != nullptr) {
    return fmt::format("config = {} (cannot be read)", app.get_config_ptr()->as<std::string>());
  }
  return text;
}

}  // namespace proofmass::wire
