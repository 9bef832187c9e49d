#include "proto/command_line/described_program.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <cstddef>
#include <string_view>
#include <utility>

namespace proofmass::wire {
namespace {

std::vector<std::string> split_at(std::string_view text, char separator) {
  std::vector<std::string> parts;
  for (std::size_t end = 0; end != std::string_view::npos; text.remove_prefix(end + 1)) {
    end = text.find(separator);
    parts.emplace_back(text.substr(0, end));
    if (end == std::string_view::npos) break;
  }
  return parts;
}

/// Help texts are broken into lines for a terminal of 80 columns; manuals break their own.
std::string on_one_line(std::string text) {
  std::ranges::replace(text, '\n', ' ');
  return text;
}

void describe_value(const std::string& type_name, DescribedOption& option) {
  const std::size_t range = type_name.find(":[");
  option.value_name = type_name.substr(0, range);
  if (range != std::string::npos) option.range = type_name.substr(range + 1);
  const std::string& name = option.value_name;
  if (name.find('|') != std::string::npos) {
    option.kind = ValueKind::word;
    option.words = split_at(name, '|');
  } else if (name == file_type || name.starts_with(std::string(file_type) + ".")) {
    option.kind = ValueKind::file;
    option.extension = name.substr(std::string_view(file_type).size());
  } else {
    option.kind = name == directory_type ? ValueKind::directory : ValueKind::text;
  }
}

DescribedOption described_option(const CLI::Option& option) {
  DescribedOption described;
  described.text = on_one_line(option.get_description());
  described.default_value = option.get_default_str();
  described.variable = option.get_envname();
  described.is_required = option.get_required();
  described.is_repeatable = option.get_expected_max() > 1;
  for (const std::string& name : option.get_snames()) described.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) described.names.push_back("--" + name);
  if (option.get_positional()) described.names = {option.get_name(true)};
  if (option.get_items_expected_max() > 0) describe_value(option.get_type_name(), described);
  return described;
}

std::vector<DescribedExit> exits_in(const std::string& footer) {
  std::vector<DescribedExit> exits;
  for (const std::string& line : split_at(footer, '\n')) {
    if (!line.starts_with("  ") || std::isdigit(static_cast<unsigned char>(line[2])) == 0) continue;
    const std::size_t end = line.find(' ', 2);
    exits.push_back({line.substr(2, end - 2), line.substr(line.find_first_not_of(' ', end))});
  }
  return exits;
}

}  // namespace

DescribedCommand described_program(const CLI::App& app) {
  DescribedCommand described{.name = app.get_name(),
                             .text = on_one_line(app.get_description()),
                             .arguments = {},
                             .options = {},
                             .exits = exits_in(app.get_footer()),
                             .commands = {}};
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;
    auto& kind = option->get_positional() ? described.arguments : described.options;
    kind.push_back(described_option(*option));
  }
  for (const CLI::App* command : app.get_subcommands({})) {
    if (!command->get_group().empty()) described.commands.push_back(described_program(*command));
  }
  return described;
}

}  // namespace proofmass::wire
